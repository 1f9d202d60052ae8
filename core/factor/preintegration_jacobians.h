// Derivatives of a preintegrated motion with respect to biases and IMU
// intrinsics, propagated from step to step. Internal to core/factor.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_step.h"
#include "core/model/calibration.h"

namespace selfcal::preintegration {

// Derivatives of (psi, Delta_v, Delta_p), psi the left perturbation of the
// rotation, with respect to (b_a 3, b_g 3) and to theta_i in the order of
// calibration.h.
template <typename T>
struct MotionDerivatives {
  Eigen::Matrix<T, 9, 6> bias;
  Eigen::Matrix<T, 9, kImuTangentSize> theta;
};

template <typename T>
class MotionJacobians {
 public:
  void AddGyro(const Stage<T>& s, const RateResponse<T>& response) {
    for (int c = 0; c < 9; ++c) {
      const Vector3<T> psi = psi_.col(c);
      const Vector3<T> v = v_gyro_.col(c);
      p_gyro_.col(c) += s.h * v - s.dp.cross(psi) + response.p.col(c);
      v_gyro_.col(c) = v - s.dv.cross(psi) + response.v.col(c);
      psi_.col(c) = psi + response.psi.col(c);
    }
  }

  void AddAccel(const Stage<T>& s,
                const ForceResponse<T>& response,
                const Reading<T>& r0,
                const Reading<T>& r1) {
    p_accel_[0] += s.h * v_accel_[0] + response.p;
    v_accel_[0] += response.v;
    const T sixth = s.h * (1.0 / 6);
    for (int i = 0; i < 3; ++i) {
      const T a_0 = sixth * r0.h_A[i];
      const T a_1 = sixth * r1.h_A[i];
      const T a_m = a_0 + a_1;  // half of the weight of the middle
      Matrix3<T>& v = v_accel_[1 + i];
      p_accel_[1 + i] += s.h * v + s.h * a_0 * s.R_0 + s.h * a_m * s.R_m;
      v += a_0 * s.R_0 + 2.0 * a_m * s.R_m + a_1 * s.R_1;
    }
  }

  // Derivatives with respect to constant errors of the raw readings: those with
  // respect to the biases with the opposite sign.
  GyroResponse<T> ByGyro(const Matrix3<T>& T_g_inverse) const {
    return {psi_.template leftCols<3>().lazyProduct(T_g_inverse),
            v_gyro_.template leftCols<3>().lazyProduct(T_g_inverse),
            p_gyro_.template leftCols<3>().lazyProduct(T_g_inverse)};
  }
  AccelResponse<T> ByAccel(const Matrix3<T>& accel_correction) const {
    return {v_accel_[0].lazyProduct(accel_correction),
            p_accel_[0].lazyProduct(accel_correction)};
  }

  // `accel_correction` is R_AI^T T_a^-1.
  MotionDerivatives<T> Result(const Correction<T>& correction,
                              const Matrix3<T>& accel_correction) const {
    MotionDerivatives<T> result;
    const auto write_gyro = [&](const RateColumns<T>& by_rates, int row) {
      WriteGyro(by_rates, correction.T_g_inverse, row, &result);
    };
    write_gyro(psi_, 0);
    write_gyro(v_gyro_, 3);
    write_gyro(p_gyro_, 6);
    result.bias.template topLeftCorner<3, 3>().setZero();
    result.theta.template block<3, 9>(0, kAccelScale).setZero();
    WriteAccel(v_accel_, correction.R_IA, accel_correction, 3, &result);
    WriteAccel(p_accel_, correction.R_IA, accel_correction, 6, &result);
    return result;
  }

 private:
  using Forces = std::array<Matrix3<T>, 4>;

  // A corrected rate w = B (w~ - b), B = T_g^-1, changes with (b, s, m) by
  // -B (db + dT w).
  static void WriteGyro(const RateColumns<T>& J,
                        const Matrix3<T>& B,
                        int row,
                        MotionDerivatives<T>* result) {
    result->bias.template block<3, 3>(row, 3) =
        -J.template leftCols<3>().lazyProduct(B);
    auto theta = result->theta.template middleRows<3>(row);
    theta.col(kGyroScale + 0) = -B(0, 0) * J.col(3);
    theta.col(kGyroScale + 1) = -B(0, 1) * J.col(6) - B(1, 1) * J.col(4);
    theta.col(kGyroScale + 2) =
        -B(0, 2) * J.col(7) - B(1, 2) * J.col(8) - B(2, 2) * J.col(5);
    theta.col(kGyroMisalignment + 0) = -B(0, 0) * J.col(6);
    theta.col(kGyroMisalignment + 1) = -B(0, 0) * J.col(7);
    theta.col(kGyroMisalignment + 2) = -B(0, 1) * J.col(7) - B(1, 1) * J.col(8);
  }

  static void WriteAccel(const Forces& M,
                         const Matrix3<T>& R_IA,
                         const Matrix3<T>& B,
                         int row,
                         MotionDerivatives<T>* result) {
    result->bias.template block<3, 3>(row, 0) = -M[0].lazyProduct(B);
    auto theta = result->theta.template middleRows<3>(row);
    const auto product = [&](int k, int column) -> Vector3<T> {
      return M[k].lazyProduct(B.col(column));
    };
    theta.col(kAccelScale + 0) = -product(1, 0);
    theta.col(kAccelScale + 1) = -product(2, 1);
    theta.col(kAccelScale + 2) = -product(3, 2);
    theta.col(kAccelMisalignment + 0) = -product(2, 0);
    theta.col(kAccelMisalignment + 1) = -product(3, 0);
    theta.col(kAccelMisalignment + 2) = -product(3, 1);
    // (R_AI Exp(d))^T h = f + [f]x d.
    theta.template middleCols<3>(kAccelRotation) =
        TimesSkew<T>(M[1], R_IA.col(0)) + TimesSkew<T>(M[2], R_IA.col(1)) +
        TimesSkew<T>(M[3], R_IA.col(2));
  }

  RateColumns<T> psi_ = RateColumns<T>::Zero();
  RateColumns<T> v_gyro_ = RateColumns<T>::Zero();
  RateColumns<T> p_gyro_ = RateColumns<T>::Zero();
  // Integral and double integral of R h_k, for h_k in (1, h_A). A derivative of
  // f is a constant matrix times one of these four, so these eight matrices
  // contain the derivatives with respect to all accelerometer parameters.
  Forces v_accel_ = {Matrix3<T>::Zero(),
                     Matrix3<T>::Zero(),
                     Matrix3<T>::Zero(),
                     Matrix3<T>::Zero()};
  Forces p_accel_ = v_accel_;
};

}  // namespace selfcal::preintegration
