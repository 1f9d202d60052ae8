// Derivatives by the time offset of the second IMU: its readings stamped t are
// of the time t + offset, so that a larger offset moves the interval that is
// integrated to earlier stamps (StateOfImu has them).
//
// They are central differences over kDelayStep_ns, of a motion that is smooth
// but for the corners of the readings at samples. There the difference has the
// mean of both sides: for white readings at 200 Hz, where a corner is at the
// end of the interval, the rate there is wrong by 0.6 % of their standard
// deviation (sqrt(6) / 4 of the step over the period).
//
// Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "core/factor/inertial.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

inline constexpr std::int64_t kDelayStep_ns = 50'000;

// Derivative of the motion that is measured from the state y0 of the IMU to the
// time of y1: (psi 3, a left perturbation of Delta_R [rad/s], Delta_v 3,
// Delta_p 3).
Eigen::Matrix<double, 9, 1> MotionByDelay(std::span<const ImuSample> samples,
                                          const KeyframeState& y0,
                                          const KeyframeState& y1,
                                          const ImuCalibration& imu);

// Derivative of the residual between both states, which is given
// (EvaluateInertial).
InertialResidual ResidualByDelay(std::span<const ImuSample> samples,
                                 const KeyframeState& y0,
                                 const KeyframeState& y1,
                                 const ImuCalibration& imu,
                                 const InertialResidual& residual);

}  // namespace selfcal
