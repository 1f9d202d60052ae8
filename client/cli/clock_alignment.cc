#include "client/cli/clock_alignment.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "client/cli/context.h"
#include "client/odometry/clock_shift.h"

namespace selfcal::client {

absl::Status AlignClocks(const std::string& session,
                         const Calibration& theta,
                         const UnknownOfCamera& unknown,
                         Recording* recording) {
  const auto shift_ns = FindClockShift(recording, theta, unknown);
  if (!shift_ns.ok()) {
    return absl::Status(
        shift_ns.status().code(),
        fmt::format(
            "{}: {}", session, std::string(shift_ns.status().message())));
  }
  if (*shift_ns == 0) return absl::OkStatus();
  recording->ShiftReadings(*shift_ns);
  PrintError(fmt::format(
      "{}: the clock of the readings is {:.3f} s {} that of the images: their "
      "stamps are taken {} by that, and time offsets are in addition to it. "
      "Where clocks begin with each recording, so do time offsets: calibrate "
      "such recordings one by one",
      session,
      1e-9 * std::abs(static_cast<double>(*shift_ns)),
      *shift_ns < 0 ? "ahead of" : "behind",
      *shift_ns < 0 ? "earlier" : "later"));
  return absl::OkStatus();
}

}  // namespace selfcal::client
