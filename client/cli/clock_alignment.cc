#include "client/cli/clock_alignment.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "client/cli/context.h"
#include "client/cli/progress.h"
#include "client/odometry/clock_shift.h"

namespace selfcal::client {

absl::Status AlignClocks(const Calibration& theta,
                         const UnknownOfCamera& unknown,
                         RecordedSession* session) {
  if (session->clocks_agree) return absl::OkStatus();
  Progress progress(session->name);
  progress.Say("comparing the clocks of images and readings");
  const auto shift_ns =
      FindClockShift(session->recording.get(), theta, unknown);
  progress.Clear();
  if (!shift_ns.ok()) {
    return absl::Status(
        shift_ns.status().code(),
        fmt::format(
            "{}: {}", session->name, std::string(shift_ns.status().message())));
  }
  session->clocks_agree = true;
  if (*shift_ns == 0) return absl::OkStatus();
  session->recording->ShiftReadings(*shift_ns);
  PrintError(fmt::format(
      "{}: the clock of the readings is {:.3f} s {} that of the images: the "
      "timestamps of the readings are shifted {} by this amount, and time "
      "offsets are in addition to it. "
      "Where clocks begin with each recording, so do time offsets: calibrate "
      "such recordings one by one",
      session->name,
      1e-9 * std::abs(static_cast<double>(*shift_ns)),
      *shift_ns < 0 ? "ahead of" : "behind",
      *shift_ns < 0 ? "earlier" : "later"));
  return absl::OkStatus();
}

}  // namespace selfcal::client
