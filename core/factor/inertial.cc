#include "core/factor/inertial.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Offsets in the residual; the first three as in Preintegration.
constexpr int kRotation = 0;
constexpr int kVelocity = 3;
constexpr int kPosition = 6;
constexpr int kAccelBias = 9;
constexpr int kGyroBias = 12;

// What the two states say about the motion between them, in the body frame of
// the first, gravity taken out.
struct StateMotion {
  Eigen::Quaterniond q_01;
  Vector3d v;
  Vector3d p;
};

StateMotion MotionBetween(const KeyframeState& x0,
                          const KeyframeState& x1,
                          double dt,
                          double gravity_mps2) {
  const Vector3d g(0, 0, -gravity_mps2);
  const Eigen::Quaterniond q_IG = x0.q_GI.conjugate();
  return {q_IG * x1.q_GI,
          q_IG * (x1.v_GI - x0.v_GI - dt * g),
          q_IG * (x1.p_GI - x0.p_GI - dt * x0.v_GI - 0.5 * dt * dt * g)};
}

void FillJacobians(const KeyframeState& x0,
                   const StateMotion& motion,
                   const Preintegration& imu,
                   const Vector3d& rotation_residual,
                   InertialJacobians* jacobians) {
  const Matrix3d I = Matrix3d::Identity();
  const Matrix3d R_IG = x0.q_GI.toRotationMatrix().transpose();
  const Matrix3d J_inverse = RightJacobianInverse(rotation_residual);

  InertialMatrix& J1 = jacobians->x1;
  J1.setZero();
  J1.block<3, 3>(kRotation, kStateRotation) = J_inverse;
  J1.block<3, 3>(kVelocity, kStateVelocity) = R_IG;
  J1.block<3, 3>(kPosition, kStatePosition) = R_IG;
  J1.block<3, 3>(kAccelBias, kStateAccelBias) = I;
  J1.block<3, 3>(kGyroBias, kStateGyroBias) = I;

  InertialMatrix& J0 = jacobians->x0;
  J0 = -J1;
  J0.block<3, 3>(kRotation, kStateRotation) =
      -J_inverse * motion.q_01.toRotationMatrix().transpose();
  J0.block<3, 3>(kVelocity, kStateRotation) = Skew(motion.v);
  J0.block<3, 3>(kPosition, kStateRotation) = Skew(motion.p);
  J0.block<3, 3>(kPosition, kStateVelocity) = -imu.dt_s * R_IG;

  // Log(Exp(-d) E) = Log(E) - J_l^-1 d for d on the right of Delta_R, and
  // J_l^-1(phi) = J_r^-1(-phi).
  const Matrix3d by_Delta_R = -RightJacobianInverse(-rotation_residual);
  static_assert(kStateGyroBias == kStateAccelBias + 3);
  J0.block<3, 6>(kRotation, kStateAccelBias) =
      by_Delta_R * imu.J_bias.topRows<3>();
  J0.block<6, 6>(kVelocity, kStateAccelBias) = -imu.J_bias.bottomRows<6>();

  InertialMatrix& J_theta = jacobians->theta;
  J_theta.setZero();
  J_theta.topRows<3>() = by_Delta_R * imu.J_theta.topRows<3>();
  J_theta.middleRows<6>(kVelocity) = -imu.J_theta.bottomRows<6>();
}

InertialMatrix ResidualCovariance(const Preintegration& imu,
                                  const Vector3d& rotation_residual,
                                  const ImuNoise& noise) {
  InertialMatrix covariance = InertialMatrix::Zero();
  auto motion = covariance.topLeftCorner<9, 9>();
  motion = imu.covariance;
  // All nine enter the residual negatively, the rotation through Log.
  const Matrix3d J_l_inverse = RightJacobianInverse(-rotation_residual);
  motion.topRows<3>() = (J_l_inverse * motion.topRows<3>()).eval();
  motion.leftCols<3>() =
      (motion.leftCols<3>() * J_l_inverse.transpose()).eval();
  covariance.diagonal().tail<6>() =
      BiasWalkSigmas(noise, imu.dt_s).array().square();
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
  const StateMotion motion = MotionBetween(x0, x1, measured.dt_s, gravity_mps2);

  InertialResidual residual;
  const Vector3d rotation = Log(measured.Delta_R.conjugate() * motion.q_01);
  residual.segment<3>(kRotation) = rotation;
  residual.segment<3>(kVelocity) = motion.v - measured.Delta_v;
  residual.segment<3>(kPosition) = motion.p - measured.Delta_p;
  residual.segment<3>(kAccelBias) = x1.b_a - x0.b_a;
  residual.segment<3>(kGyroBias) = x1.b_g - x0.b_g;

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
  // Turned around, so that the lower factor of the turned matrix is an upper
  // one of the matrix itself: C = U U^T, W = U^-1.
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
