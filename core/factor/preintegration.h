// Integrates the IMU samples between two keyframes into one relative motion,
// with its derivatives with respect to the biases and the IMU intrinsics,
// and its covariance.
//
// Scheme. Raw readings, minus h^2/12 of their second derivative, are linear
// between samples, hence so are the corrected
//   w = T_g^-1 (w~ - b_g),   f = R_AI^T T_a^-1 (a~ - b_a).
// Over a step of h from (w_0, f_0) to (w_1, f_1):
//   rotation by Exp(h (w_0 + w_1) / 2 + h^2 (w_0 x w_1) / 12), the fourth order
//   Magnus expansion; velocity and position by Simpson's rule, with the
//   rotation at the middle from the same expansion over half a step.
// The scheme is of fourth order in h on smooth motion, with samples at least
// one step beyond both ends; the partial steps at ends between samples are of
// third order, and the errors of neighbouring intervals cancel there.
//
// The sensors of a coupled IMU correct each other (imu_model.h); then f is not
// linear, and evaluated at the three places of Simpson's rule, with
// dw/dt = (w_1 - w_0) / h.
//
// The derivatives are exactly those of this scheme. The noise of each sensor is
// white: over a step its mean has the variance density^2 / h on the raw reading
// and is transformed by T^-1; it is larger where samples are missing
// (sampling.h). Of a coupled IMU, what each sensor's noise does to the readings
// of the other is left out, but for the centripetal force: for 1e-3 rad s/m and
// 5 cm, over 0.1 s, the noise of the accelerometer is a thousandth of the
// variance of the rotation, and that of the rate at either end 4 % of the
// variance of the velocity. Biases random-walk from their given values at the
// beginning of the interval (preintegration_bias_walk.h).
//
// Pure, callable from any thread; allocates nothing.
// Source: Schneider et al., ICRA 2017, III-B and III-D; Forster et al., "On-
// Manifold Preintegration for Real-Time Visual-Inertial Odometry" (2017), with
// the IMU intrinsics added.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Motion in the body frame of the first keyframe, gravity not included:
//   R_GI1 = R_GI0 Delta_R
//   v_1   = v_0 + g dt + R_GI0 Delta_v
//   p_1   = p_0 + v_0 dt + g dt^2 / 2 + R_GI0 Delta_p
// Tangent order of the nine: (Delta_R 3 right perturbation, Delta_v, Delta_p).
struct Preintegration {
  double dt_s = 0;
  Eigen::Quaterniond Delta_R = Eigen::Quaterniond::Identity();
  Eigen::Vector3d Delta_v = Eigen::Vector3d::Zero();  // [m/s]
  Eigen::Vector3d Delta_p = Eigen::Vector3d::Zero();  // [m]
  // Derivatives with respect to (b_a 3, b_g 3), and to theta_i in the order of
  // calibration.h.
  Eigen::Matrix<double, 9, 6> J_bias = Eigen::Matrix<double, 9, 6>::Zero();
  Eigen::Matrix<double, 9, Eigen::Dynamic, 0, 9, kMaxImuTangentSize> J_theta;
  // Covariance of the nine, from the white noise of the sensors and the walk of
  // their biases; and that of the nine with the walk of (b_a 3, b_g 3) at the
  // end.
  Eigen::Matrix<double, 9, 9> covariance = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 6> covariance_with_walk =
      Eigen::Matrix<double, 9, 6>::Zero();
};

// Parts to compute in addition to the motion; the rest remains zero, or empty.
struct PreintegrationParts {
  bool jacobians = true;
  bool covariance = true;
};

// Integrates from t0_ns to t1_ns >= t0_ns, with interpolated end points. The
// samples (at least one) must cover the interval, which Validate(segment)
// ensures, and should extend one sample further on either side; beyond the
// first and the last sample their readings are held constant.
Preintegration Preintegrate(std::span<const ImuSample> samples,
                            std::int64_t t0_ns,
                            std::int64_t t1_ns,
                            const ImuCalibration& imu,
                            const Eigen::Vector3d& b_a,
                            const Eigen::Vector3d& b_g,
                            const ImuNoise& noise,
                            const PreintegrationParts& parts = {});

}  // namespace selfcal
