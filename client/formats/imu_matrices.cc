#include "client/formats/imu_matrices.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>

#include "client/formats/format_error.h"

namespace selfcal::client {
namespace {

// M = L R with a positive diagonal; det R has the sign of det M.
Factors SignedLowerFactors(const Eigen::Matrix3d& M) {
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr(M.transpose());
  const Eigen::Matrix3d upper =
      qr.matrixQR().triangularView<Eigen::Upper>().toDenseMatrix();
  const Eigen::Matrix3d Q = qr.householderQ();
  Eigen::Vector3d signs;
  for (int i = 0; i < 3; ++i) signs[i] = upper(i, i) < 0 ? -1 : 1;
  return {upper.transpose() * signs.asDiagonal(),
          signs.asDiagonal() * Q.transpose()};
}

void CheckOrientation(const Eigen::Matrix3d& M) {
  constexpr double kLeast = 1e-6;  // far below any real scale
  if (M.allFinite() && M.determinant() > kLeast) return;
  throw FormatError(
      "a matrix of the IMU is singular or mirrors its axes (its determinant is "
      "not positive)");
}

}  // namespace

Factors LowerFactors(const Eigen::Matrix3d& M) {
  CheckOrientation(M);
  return SignedLowerFactors(M);
}

Factors UpperFactors(const Eigen::Matrix3d& M) {
  CheckOrientation(M);
  // Reversing rows and columns turns a lower triangle into an upper one.
  const Factors reversed = SignedLowerFactors(M.colwise().reverse());
  return {reversed.triangular.reverse(), reversed.R.colwise().reverse()};
}

ImuInBody FromMatrices(const ImuMatrices& matrices) {
  const Factors gyro = UpperFactors(matrices.G);
  const Factors accel = UpperFactors(matrices.A);
  ImuInBody result;
  result.R_IB = gyro.R;
  const auto above = [](const Eigen::Matrix3d& T) {
    return Eigen::Vector3d(T(0, 1), T(0, 2), T(1, 2));
  };
  result.imu.s_g = gyro.triangular.diagonal();
  result.imu.m_g = above(gyro.triangular);
  result.imu.s_a = accel.triangular.diagonal();
  result.imu.m_a = above(accel.triangular);
  result.imu.q_AI =
      Eigen::Quaterniond(accel.R * gyro.R.transpose()).normalized();
  if (!matrices.G_f.isZero(0)) {
    const Eigen::Matrix3d T_s = matrices.G_f * gyro.R.transpose();
    result.imu.gyro_g_sensitivity = T_s.reshaped<Eigen::RowMajor>();
  }
  if (!matrices.r.isZero(0)) {
    const Eigen::Matrix3d r_I = gyro.R * matrices.r;
    const bool same = matrices.r.col(1) == matrices.r.col(0) &&
                      matrices.r.col(2) == matrices.r.col(0);
    result.imu.accel_position = r_I.reshaped().head(same ? 3 : 9);
  }
  return result;
}

AccelFrame ToAccelFrame(const ImuCalibration& imu) {
  const Factors accel =
      LowerFactors(imu.T_a() * imu.q_AI.normalized().toRotationMatrix());
  return {{.G = imu.T_g() * accel.R.transpose(),
           .A = accel.triangular,
           .G_f = imu.T_s() * accel.R.transpose(),
           .r = accel.R * imu.AccelPositions()},
          accel.R};
}

Eigen::Matrix4d TransformFromBody(const CameraCalibration& camera,
                                  const Eigen::Matrix3d& R_BI) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() =
      camera.q_CI.normalized().toRotationMatrix() * R_BI.transpose();
  T.topRightCorner<3, 1>() = camera.p_CI;
  return T;
}

void SetTransformFromBody(const Eigen::Matrix4d& T_CB,
                          const Eigen::Matrix3d& R_BI,
                          CameraCalibration* camera) {
  const Eigen::Matrix3d R_CI = T_CB.topLeftCorner<3, 3>() * R_BI;
  camera->q_CI = Eigen::Quaterniond(R_CI).normalized();
  camera->p_CI = T_CB.topRightCorner<3, 1>();
}

Eigen::Matrix4d RigidInverse(const Eigen::Matrix4d& T) {
  Eigen::Matrix4d inverse = Eigen::Matrix4d::Identity();
  inverse.topLeftCorner<3, 3>() = T.topLeftCorner<3, 3>().transpose();
  inverse.topRightCorner<3, 1>() =
      -T.topLeftCorner<3, 3>().transpose() * T.topRightCorner<3, 1>();
  return inverse;
}

}  // namespace selfcal::client
