// Derivatives with respect to biases and IMU intrinsics: the changes of
// corrected readings on which they depend, and how they follow from the
// response of the motion to those, for two separate sensors;
// coupled_derivatives.h is for a coupled IMU. Only these files of core/factor
// name the parameters of the IMU. Internal to core/factor.
//
// A corrected rate w = B (gyro - b_g), B = T_g^-1, changes with (b, s, m) by
// -B (db + dT w): by an offset of its axes, and by changes of an axis in
// proportion to an axis. A corrected force f = R_IA T_a^-1 (accel - b_a)
// changes by a constant matrix times one of (1, h_A).
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/factor/preintegration_step.h"
#include "core/model/calibration.h"
#include "core/model/imu_model.h"

namespace selfcal::preintegration {

// Derivatives of (psi, Delta_v, Delta_p), psi the left perturbation of the
// rotation, with respect to (b_a 3, b_g 3) and to theta_i in the order of
// calibration.h.
template <typename T>
struct MotionDerivatives {
  Eigen::Matrix<T, 9, 6> bias;
  Eigen::Matrix<T, 9, kImuTangentSize> theta;
  static constexpr int columns = kImuTangentSize;
};

// Derivatives with respect to changes of the corrected rates: an offset of each
// axis 3, then a change of axis r in proportion to axis c, (r, c) = (0, 0), (1,
// 1), (2, 2), (0, 1), (0, 2), (1, 2). Those with respect to the raw readings
// follow from them, since T_g is upper triangular.
inline constexpr int kRateChanges = 9;
template <typename T>
using RateColumns = Eigen::Matrix<T, 3, kRateChanges>;

// A dphi for these changes (3 x 9, in the order of RateColumns, per rad/s), for
// a matrix A that is applied afterwards. With dw
// = e_r w_c,
//   dphi = alpha_c e_r + coning (w_0c e_r x w_1 + w_1c w_0 x e_r)
//        = alpha_c e_r + e_r x (kappa x e_c)
//        = alpha_c e_r - kappa_r e_c + (e_r . e_c) kappa.
template <typename T>
RateColumns<T> ByRates(const Matrix3<T>& A, const Turn<T>& turn) {
  RateColumns<T> J;
  J.template leftCols<3>() = turn.gain * A - TimesSkew(A, turn.drift);
  const Vector3<T> A_kappa = A * turn.kappa;
  for (int i = 0; i < 3; ++i) {
    J.col(3 + i) = (turn.alpha[i] - turn.kappa[i]) * A.col(i) + A_kappa;
  }
  J.col(6) = turn.alpha[1] * A.col(0) - turn.kappa[0] * A.col(1);
  J.col(7) = turn.alpha[2] * A.col(0) - turn.kappa[0] * A.col(2);
  J.col(8) = turn.alpha[2] * A.col(1) - turn.kappa[1] * A.col(2);
  return J;
}

// Integrals of R for a constant force, and of R times each of the weights of a
// reading.
inline constexpr int kForceWeights = 3;
template <typename T>
using ForceIntegrals = std::array<Matrix3<T>, 1 + kForceWeights>;

template <typename T>
ForceIntegrals<T> ZeroForceIntegrals() {
  ForceIntegrals<T> integrals;
  integrals.fill(Matrix3<T>::Zero());
  return integrals;
}

template <typename T>
const Vector3<T>& ForceWeights(const Reading<T>& reading) {
  return reading.h_A;
}

// Responses of the motion to changes of rates and forces; forces do not change
// the rotation.
template <typename T>
struct MotionResponses {
  RateColumns<T> psi_by_rates = RateColumns<T>::Zero();
  RateColumns<T> v_by_rates = RateColumns<T>::Zero();
  RateColumns<T> p_by_rates = RateColumns<T>::Zero();
  ForceIntegrals<T> v_by_forces = ZeroForceIntegrals<T>();
  ForceIntegrals<T> p_by_forces = ZeroForceIntegrals<T>();
};

// The three rows of derivatives from `row` on, by what changes rates.
template <typename T>
void WriteByRates(const RateColumns<T>& J,
                  const ImuModel<T>& imu,
                  int row,
                  MotionDerivatives<T>* result) {
  const Matrix3<T>& B = imu.T_g_inverse;
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

// The same by what changes forces.
template <typename T>
void WriteByForces(const ForceIntegrals<T>& M,
                   const ImuModel<T>& imu,
                   const Matrix3<T>& force_by_accel,
                   int row,
                   MotionDerivatives<T>* result) {
  const Matrix3<T>& B = force_by_accel;
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
      TimesSkew<T>(M[1], imu.R_IA.col(0)) +
      TimesSkew<T>(M[2], imu.R_IA.col(1)) + TimesSkew<T>(M[3], imu.R_IA.col(2));
}

// `force_by_accel` is ImuModel::ForceByAccel.
template <typename T>
MotionDerivatives<T> DerivativesOf(const MotionResponses<T>& responses,
                                   const ImuModel<T>& imu,
                                   const Matrix3<T>& force_by_accel) {
  MotionDerivatives<T> result;
  WriteByRates<T>(responses.psi_by_rates, imu, 0, &result);
  WriteByRates<T>(responses.v_by_rates, imu, 3, &result);
  WriteByRates<T>(responses.p_by_rates, imu, 6, &result);
  result.bias.template topLeftCorner<3, 3>().setZero();
  result.theta.template block<3, 9>(0, kAccelScale).setZero();
  WriteByForces<T>(responses.v_by_forces, imu, force_by_accel, 3, &result);
  WriteByForces<T>(responses.p_by_forces, imu, force_by_accel, 6, &result);
  return result;
}

}  // namespace selfcal::preintegration
