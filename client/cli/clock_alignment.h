// Recordings whose images and readings have different clocks.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "client/odometry/start.h"
#include "client/recording/recording.h"
#include "core/model/calibration.h"

namespace selfcal::client {

// Moves the readings of a recording to the clock of its images, if they have
// another one (FindClockShift), and says by how much. `unknown` is that of the
// first camera.
absl::Status AlignClocks(const std::string& session,
                         const Calibration& theta,
                         const UnknownOfCamera& unknown,
                         Recording* recording);

}  // namespace selfcal::client
