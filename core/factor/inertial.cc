#include "core/factor/inertial.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/factor/inertial_terms.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void FillJacobians(const KeyframeState& x0,
                   const StateMotion<double>& motion,
                   const Preintegration& imu,
                   const Vector3d& rotation_residual,
                   InertialJacobians* jacobians) {
  const Matrix3d I = Matrix3d::Identity();
  const Matrix3d R_IG = x0.q_GI.toRotationMatrix().transpose();
  const Matrix3d J_inverse = RightJacobianInverse(rotation_residual);

  InertialMatrix& J1 = jacobians->x1;
  J1.setZero();
  J1.block<3, 3>(kResidualRotation, kStateRotation) = J_inverse;
  J1.block<3, 3>(kResidualVelocity, kStateVelocity) = R_IG;
  J1.block<3, 3>(kResidualPosition, kStatePosition) = R_IG;
  J1.block<3, 3>(kResidualAccelBias, kStateAccelBias) = I;
  J1.block<3, 3>(kResidualGyroBias, kStateGyroBias) = I;

  InertialMatrix& J0 = jacobians->x0;
  J0 = -J1;
  J0.block<3, 3>(kResidualRotation, kStateRotation) =
      -J_inverse * motion.q_01.toRotationMatrix().transpose();
  J0.block<3, 3>(kResidualVelocity, kStateRotation) = Skew(motion.v);
  J0.block<3, 3>(kResidualPosition, kStateRotation) = Skew(motion.p);
  J0.block<3, 3>(kResidualPosition, kStateVelocity) = -imu.dt_s * R_IG;

  // Log(Exp(-d) E) = Log(E) - J_l^-1 d for d on the right of Delta_R, and
  // J_l^-1(phi) = J_r^-1(-phi).
  const Matrix3d by_Delta_R = -RightJacobianInverse(-rotation_residual);
  static_assert(kStateGyroBias == kStateAccelBias + 3);
  J0.block<3, 6>(kResidualRotation, kStateAccelBias) =
      by_Delta_R * imu.J_bias.topRows<3>();
  J0.block<6, 6>(kResidualVelocity, kStateAccelBias) =
      -imu.J_bias.bottomRows<6>();

  auto& J_theta = jacobians->theta;
  J_theta.setZero(15, imu.J_theta.cols());
  J_theta.topRows<3>() = by_Delta_R * imu.J_theta.topRows<3>();
  J_theta.middleRows<6>(kResidualVelocity) = -imu.J_theta.bottomRows<6>();
}

InertialMatrix ResidualCovariance(const Preintegration& imu,
                                  const Vector3d& rotation_residual,
                                  const ImuNoise& noise) {
  InertialMatrix covariance = InertialMatrix::Zero();
  covariance.topLeftCorner<9, 9>() = imu.covariance;
  // All nine enter the residual with a negative sign, the rotation through Log.
  covariance.topRightCorner<9, 6>() = -imu.covariance_with_walk;
  covariance.bottomLeftCorner<6, 9>() = -imu.covariance_with_walk.transpose();
  covariance.diagonal().tail<6>() =
      BiasWalkSigmas(noise, imu.dt_s).array().square();
  const Matrix3d J_l_inverse = RightJacobianInverse(-rotation_residual);
  covariance.topRows<3>() = (J_l_inverse * covariance.topRows<3>()).eval();
  covariance.leftCols<3>() =
      (covariance.leftCols<3>() * J_l_inverse.transpose()).eval();
  return covariance;
}

}  // namespace

InertialResidual EvaluateInertial(std::span<const ImuSample> samples,
                                  const KeyframeState& x0,
                                  const KeyframeState& x1,
                                  const ImuCalibration& imu,
                                  const ImuNoise& noise,
                                  double gravity_mps2,
                                  InertialJacobians* jacobians,
                                  InertialMatrix* covariance) {
  const PreintegrationParts parts = {.jacobians = jacobians != nullptr,
                                     .covariance = covariance != nullptr};
  const Preintegration measured = Preintegrate(
      samples, x0.t_ns, x1.t_ns, imu, x0.b_a, x0.b_g, noise, parts);
  const StateMotion<double> motion =
      MotionBetween(x0, x1, measured.dt_s, gravity_mps2);
  const InertialResidual residual = ResidualOf(x0, x1, motion, measured);
  const Vector3d rotation = residual.segment<3>(kResidualRotation);
  if (jacobians != nullptr) {
    FillJacobians(x0, motion, measured, rotation, jacobians);
  }
  if (covariance != nullptr) {
    *covariance = ResidualCovariance(measured, rotation, noise);
  }
  return residual;
}

InertialMatrix SquareRootInformation(const InertialMatrix& covariance) {
  const InertialResidual scale = covariance.diagonal().cwiseSqrt();
  const InertialResidual inverse_scale = scale.cwiseInverse();
  // The matrix is reversed, so that the lower factor of the reversed matrix is
  // an upper one of the matrix itself: C = U U^T, W = U^-1.
  const InertialMatrix correlation =
      (inverse_scale.asDiagonal() * covariance * inverse_scale.asDiagonal())
          .reverse();
  Eigen::LLT<InertialMatrix> llt(correlation);
  for (double add = 1e-14; llt.info() != Eigen::Success && add < 1; add *= 10) {
    llt.compute(correlation + add * InertialMatrix::Identity());
  }
  const InertialMatrix inverse_factor =
      llt.matrixL().solve(InertialMatrix::Identity());
  InertialMatrix W = inverse_factor.reverse();
  W *= inverse_scale.asDiagonal();
  return W;
}

Eigen::Matrix<double, 6, 1> BiasWalkSigmas(const ImuNoise& noise, double dt_s) {
  Eigen::Matrix<double, 6, 1> sigmas;
  sigmas.head<3>().setConstant(noise.accel_bias_random_walk);
  sigmas.tail<3>().setConstant(noise.gyro_bias_random_walk);
  return std::sqrt(dt_s) * sigmas;
}

}  // namespace selfcal
