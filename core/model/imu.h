// The physical quantities behind the readings of an IMU under a calibration:
// the inverse of
//   gyro = T_g w_I + b_g,   accel = T_a R_AI f_I + b_a,
// and of what ImuCalibration states of g-sensitivity and the position of the
// accelerometer.
// A program that applies a calibration needs only this header and camera.h.
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>

#include "core/model/calibration.h"

namespace selfcal {

// Angular rate and specific force in the body frame I.
struct BodyRates {
  Eigen::Vector3d w_I;  // angular rate [rad/s]
  Eigen::Vector3d f_I;  // specific force: acceleration minus gravity [m/s^2]
};

// Corrects a pair of readings with the calibration and the biases at its time:
// b_g in I, b_a in the accelerometer frame A, both as the SLAM system estimates
// them and as a keyframe of a segment stores them. A valid calibration
// (positive scales) has an inverse. The angular acceleration matters only to a
// calibration with a position of the accelerometer, 1 cm by 0.1 m/s^2 at 10
// rad/s^2; a program that does not know it better takes the difference of w_I
// between samples.
BodyRates CorrectImu(const ImuCalibration& imu,
                     const Eigen::Vector3d& gyro,   // [rad/s]
                     const Eigen::Vector3d& accel,  // [m/s^2]
                     const Eigen::Vector3d& b_g,    // [rad/s]
                     const Eigen::Vector3d& b_a,    // [m/s^2]
                     const Eigen::Vector3d& dw_I =  // [rad/s^2]
                     Eigen::Vector3d::Zero());

struct ImuBiases {
  Eigen::Vector3d b_g;  // [rad/s], in I
  Eigen::Vector3d b_a;  // [m/s^2], in A
};

// Biases for a filter that exchanges its calibration while it runs: with them,
// readings at rest give the same rate and force under `to` as under `from`. f_I
// is the specific force at rest (R_IG (0, 0, g)). Biases absorb what is wrong
// in a calibration: with those of `from`, a filter would have to estimate them
// again.
ImuBiases CarryBiases(const ImuCalibration& from,
                      const ImuCalibration& to,
                      const Eigen::Vector3d& f_I,  // [m/s^2]
                      const ImuBiases& biases);

}  // namespace selfcal
