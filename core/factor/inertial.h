// Inertial factor between two keyframes as a plain function: it integrates the
// IMU samples between them with the biases of the first and the IMU intrinsics,
// and compares the result with the states of both.
//
// The samples are integrated again (preintegration.h) at every call; nothing is
// extrapolated from an earlier linearisation point. Pure, callable from any
// thread.
// Source: Schneider et al., ICRA 2017, III-B and III-D; Forster et al., "On-
// Manifold Preintegration for Real-Time Visual-Inertial Odometry" (2017), with
// the IMU intrinsics added.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "core/factor/preintegration.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

using InertialResidual = Eigen::Matrix<double, 15, 1>;
using InertialMatrix = Eigen::Matrix<double, 15, 15>;

struct InertialJacobians {
  InertialMatrix x0;  // with respect to the first state, 15
  InertialMatrix x1;  // to the second
  // The derivative with respect to theta_i.
  Eigen::Matrix<double, 15, Eigen::Dynamic, 0, 15, kMaxImuTangentSize> theta;
};

// Residual 15, not whitened: (Log(Delta_R^T R_0^T R_1), velocity, position in
// the first body frame, b_a1 - b_a0, b_g1 - b_g0). Jacobians are filled unless
// null. The covariance of the residual (15 x 15) is filled unless null: that of
// the preintegration, propagated through Log to first order, and density^2 dt
// for the biases. The random walk of the biases affects the motion as well, and
// the two are correlated: with the default densities it adds a third to the
// variance of the velocity at 0.67 s and makes it fourfold at 2 s. The samples
// must cover [x0.t_ns, x1.t_ns], x0.t_ns < x1.t_ns.
InertialResidual EvaluateInertial(std::span<const ImuSample> samples,
                                  const KeyframeState& x0,
                                  const KeyframeState& x1,
                                  const ImuCalibration& imu,
                                  const ImuNoise& noise,
                                  double gravity_mps2,
                                  InertialJacobians* jacobians,
                                  InertialMatrix* covariance);

// Square root W of an information matrix: W^T W = covariance^-1, upper
// triangular. A whitened residual is W r. The covariance must be finite, with
// positive diagonal, which positive noise densities and dt > 0 guarantee. It is
// scaled to a unit diagonal first, since its entries span many orders of
// magnitude; if that correlation matrix is singular to rounding, the smallest
// multiple of the identity that makes it regular (in powers of ten from 1e-14)
// is added, so that W is always finite.
InertialMatrix SquareRootInformation(const InertialMatrix& covariance);

// Standard deviations of the six bias differences (b_a 3, b_g 3) over a gap of
// dt_s without IMU samples: the bias random-walk factor is
// (b_a1 - b_a0, b_g1 - b_g0) divided by them.
Eigen::Matrix<double, 6, 1> BiasWalkSigmas(const ImuNoise& noise, double dt_s);

}  // namespace selfcal
