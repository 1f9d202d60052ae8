// Moves the state of a keyframe in time, along the motion that the IMU
// measured.
//
// Pure, callable from any thread.
#pragma once

#include <cstdint>
#include <span>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Returns the state at t_ns, from the one at state.t_ns. The samples, in order
// of time, should cover both times; beyond them the readings are extrapolated
// for some milliseconds. Without samples, or if the times are equal, only t_ns
// changes. The biases remain.
KeyframeState MoveState(const KeyframeState& state,
                        std::int64_t t_ns,
                        std::span<const ImuSample> samples,
                        const ImuCalibration& imu,
                        double gravity_mps2);

}  // namespace selfcal
