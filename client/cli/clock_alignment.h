// Recordings whose images and readings have different clocks.
#pragma once

#include <absl/status/status.h>

#include "client/cli/recorded_sessions.h"
#include "client/odometry/start.h"
#include "core/model/calibration.h"

namespace selfcal::client {

// Moves the readings of a session to the clock of its images, if they have
// another one (FindClockShift), and says by how much; once for each session.
// `unknown` is that of the first camera.
absl::Status AlignClocks(const Calibration& theta,
                         const UnknownOfCamera& unknown,
                         RecordedSession* session);

}  // namespace selfcal::client
