// The derivatives of a preintegrated motion by biases and IMU intrinsics,
// carried from step to step. Internal to core/factor.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/factor/preintegration.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// Derivatives by (b_g 3, s_g 3, m_g 3).
using GyroJacobian = Eigen::Matrix<double, 3, 9>;

// A corrected rate w = T^-1 (w~ - b) changes with (b, s, m) as it would if the
// raw reading changed by -(I, dT/ds w, dT/dm w); T is upper triangular with s
// on the diagonal and m above it.
inline GyroJacobian ByGyroParameters(const Turn& turn,
                                     const Vector3d& w_0,
                                     const Vector3d& w_1) {
  const auto column = [&](int row_of_T, int column_of_T) -> Vector3d {
    return -turn.by_0.col(row_of_T) * w_0[column_of_T] -
           turn.by_1.col(row_of_T) * w_1[column_of_T];
  };
  GyroJacobian J;
  J << -turn.by_both(), column(0, 0), column(1, 1), column(2, 2), column(0, 1),
      column(0, 2), column(1, 2);
  return J;
}

// Derivatives of the motion by all parameters of both sensors; the rotation's,
// psi, on the left.
class MotionJacobians {
 public:
  // dpsi_m and dpsi_1: what the step adds to psi in its middle and at its end.
  // A force turns with its rotation, d f = psi x f.
  void AddGyro(const Stage& s,
               const GyroJacobian& dpsi_m,
               const GyroJacobian& dpsi_1) {
    const GyroJacobian f_m = Cross(s.f_m, dpsi_m);
    p_gyro_ += s.h * v_gyro_ - Cross(s.dp, psi_) - s.h * s.h / 3 * f_m;
    v_gyro_ -= Cross(s.dv, psi_) + s.h / 6 * (4 * f_m + Cross(s.f_1, dpsi_1));
    psi_ += dpsi_1;
  }

  void AddAccel(const Stage& s, const Reading& r0, const Reading& r1) {
    AddForce(s, 1, 1, 0);
    for (int i = 0; i < 3; ++i) AddForce(s, r0.h_A[i], r1.h_A[i], 1 + i);
  }

  // `correction` is R_AI^T T_a^-1.
  void Write(const Matrix3d& R,
             const Matrix3d& R_IA,
             const Matrix3d& correction,
             Preintegration* result) const {
    Eigen::Matrix<double, 9, 9> gyro;
    gyro << R.transpose() * psi_, v_gyro_, p_gyro_;
    result->J_bias.rightCols<3>() = gyro.leftCols<3>();
    result->J_theta.middleCols<6>(kGyroScale) = gyro.rightCols<6>();
    WriteAccel(v_accel_, R_IA, correction, 3, result);
    WriteAccel(p_accel_, R_IA, correction, 6, result);
  }

 private:
  using Forces = std::array<Matrix3d, 4>;

  void AddForce(const Stage& s, double h_0, double h_1, int k) {
    const Matrix3d a_0 = h_0 * s.R_0;
    const Matrix3d a_m = (h_0 + h_1) * s.R_m;  // twice that of the middle
    p_accel_[k] += s.h * v_accel_[k] + s.h * s.h / 6 * (a_0 + a_m);
    v_accel_[k] += s.h / 6 * (a_0 + 2 * a_m + h_1 * s.R_1);
  }

  static void WriteAccel(const Forces& M,
                         const Matrix3d& R_IA,
                         const Matrix3d& B,
                         int row,
                         Preintegration* result) {
    result->J_bias.block<3, 3>(row, 0) = -M[0] * B;
    auto theta = result->J_theta.middleRows<3>(row);
    theta.col(kAccelScale + 0) = -M[1] * B.col(0);
    theta.col(kAccelScale + 1) = -M[2] * B.col(1);
    theta.col(kAccelScale + 2) = -M[3] * B.col(2);
    theta.col(kAccelMisalignment + 0) = -M[2] * B.col(0);
    theta.col(kAccelMisalignment + 1) = -M[3] * B.col(0);
    theta.col(kAccelMisalignment + 2) = -M[3] * B.col(1);
    // (R_AI Exp(d))^T h = f + [f]x d.
    theta.middleCols<3>(kAccelRotation) = TimesSkew(M[1], R_IA.col(0)) +
                                          TimesSkew(M[2], R_IA.col(1)) +
                                          TimesSkew(M[3], R_IA.col(2));
  }

  // By (b_g, s_g, m_g).
  GyroJacobian psi_ = GyroJacobian::Zero();
  GyroJacobian v_gyro_ = GyroJacobian::Zero();
  GyroJacobian p_gyro_ = GyroJacobian::Zero();
  // Integral and double integral of R h_k, for h_k in (1, h_A). A derivative of
  // f is a fixed matrix times one of these four, so these eight matrices carry
  // the derivatives by all accelerometer parameters.
  Forces v_accel_ = {
      Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()};
  Forces p_accel_ = v_accel_;
};

}  // namespace selfcal::preintegration
