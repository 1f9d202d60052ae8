// Tests whether the segments of a calibration show an effect that the rig does
// not estimate: a gyroscope that reacts to acceleration, an accelerometer whose
// axes lie apart, a time offset, a rolling shutter. What such an effect does to
// the data is not noise: theta follows it, consistently in all segments, so
// that neither residuals nor the comparison of segments need show it.
//
// The segments are linearised at theta, with the parameter blocks of all such
// effects added at their value in the rig, or zero. For each block B, with the
// rest of theta eliminated, the data gives S (B - B0) = eta with eta ~ N(0, S)
// if the value is right (a score test). If a direction of B is certain, the
// bias of theta is the step that the estimate of B would cause, by the
// covariance of the calibration on these segments: what it knows otherwise,
// from joined segments, is shifted less. Remembered segments
// (remembered_segment.h) make theta more certain, but they show the same
// effect, and shift it as much. The bias is a root mean square, with the
// uncertainty of that estimate, and with the directions of B that are not
// certain: theta follows an effect furthest where the motion shows it least.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/change/consistency.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct AbsentEffect {
  std::string block;     // "imu.accel.position", "cam0.time_offset"
  ConsistencyTest test;  // of the value that the rig has, or zero
  // Largest bias of a free component of theta, in sigmas of the calibration; 0
  // if no direction of the block is certain.
  double bias_sigmas = 0;
  std::string component;  // that one
};

// `rig` states the noise that the calibration was weighted with;
// `covariance_of_data` (D x D) is that without remembered segments
// (CalibrationResult). Segments that
// the calibration does not accept (ConsistencyTester) are ignored. In the order
// of theta; without effects that the rig estimates. None if `segments` is
// empty.
std::vector<AbsentEffect> TestAbsentEffects(
    const Rig& rig,
    const KnownCalibration& calibration,
    const Eigen::MatrixXd& covariance_of_data,
    const std::vector<MotionSegment>& segments);

}  // namespace selfcal
