// Cameras and an IMU whose stamps are by different clocks.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>

#include "client/odometry/start.h"
#include "client/recording/recording.h"
#include "core/model/calibration.h"

namespace selfcal::client {

// The time to add to the stamps of the readings of a recording so that they are
// by the clock of its images, but for a time offset within 0.15 s of that
// of the first camera; 0 if they are. It is found where the rotations of that
// camera over its first 20 s agree with those of the gyroscope. The search
// covers 10 s to either side, of no shift or, if images and readings have no
// time in common, of the shift by which both begin at once. In whole
// milliseconds.
//
// There must be an image and a reading; `unknown` is that of the first camera.
// If the rotations agree nowhere: 0 if images and readings have time in common,
// otherwise NOT_FOUND, with the reason.
absl::StatusOr<std::int64_t> FindClockShift(Recording* recording,
                                            const Calibration& theta,
                                            const UnknownOfCamera& unknown);

}  // namespace selfcal::client
