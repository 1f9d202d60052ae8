// Derivatives of a preintegrated motion with respect to biases and IMU
// intrinsics, propagated from step to step. Internal to core/factor.
#pragma once

#include <Eigen/Core>

#include "core/factor/imu_derivatives.h"
#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_response.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

template <typename T>
class MotionJacobians {
 public:
  void AddGyro(const Stage<T>& s, const RateResponse<T>& response) {
    for (int c = 0; c < kRateChanges; ++c) {
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
    for (int i = 0; i < kForceWeights; ++i) {
      const T a_0 = sixth * ForceWeights(r0)[i];
      const T a_1 = sixth * ForceWeights(r1)[i];
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
  AccelResponse<T> ByAccel(const Matrix3<T>& force_by_accel) const {
    return {v_accel_[0].lazyProduct(force_by_accel),
            p_accel_[0].lazyProduct(force_by_accel)};
  }

  MotionDerivatives<T> Result(const ImuModel<T>& imu,
                              const Matrix3<T>& force_by_accel) const {
    MotionDerivatives<T> result;
    WriteByRates<T>(psi_, imu, 0, &result);
    WriteByRates<T>(v_gyro_, imu, 3, &result);
    WriteByRates<T>(p_gyro_, imu, 6, &result);
    WriteRotationByForces<T>(&result);
    WriteByForces<T>(v_accel_, imu, force_by_accel, 3, &result);
    WriteByForces<T>(p_accel_, imu, force_by_accel, 6, &result);
    return result;
  }

 private:
  RateColumns<T> psi_ = RateColumns<T>::Zero();
  RateColumns<T> v_gyro_ = RateColumns<T>::Zero();
  RateColumns<T> p_gyro_ = RateColumns<T>::Zero();
  // Integral and double integral of R times the weights of forces: they contain
  // the derivatives with respect to all parameters that change forces.
  ForceIntegrals<T> v_accel_ = ZeroForceIntegrals<T>();
  ForceIntegrals<T> p_accel_ = v_accel_;
};

}  // namespace selfcal::preintegration
