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
// camera over its first 20 s agree with those of the gyroscope: up to 10 s away
// or, where images and readings have no time in common, up to 10 s away from
// where both begin at once. In whole milliseconds.
//
// `unknown` is that of the first camera. NOT_FOUND, with the reason, if images
// and readings have no time in common and their rotations do not agree.
absl::StatusOr<std::int64_t> FindClockShift(Recording* recording,
                                            const Calibration& theta,
                                            const UnknownOfCamera& unknown);

}  // namespace selfcal::client
