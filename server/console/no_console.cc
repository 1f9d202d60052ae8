// The implementation for a build without the console.
#include "server/console/console.h"

namespace selfcal::server {

absl::Status CheckConsole(const ConsoleOptions&) {
  return absl::FailedPreconditionError(
      "this build has no console; set console to off, or build with "
      "-DSELFCAL_CONSOLE=ON");
}

absl::StatusOr<std::unique_ptr<Console>> MakeConsole(
    const Api*, const ConsoleOptions& options) {
  return CheckConsole(options);
}

}  // namespace selfcal::server
