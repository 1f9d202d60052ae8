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
    PropagateColumns(
        s, response, &of_.psi_by_rates, &of_.v_by_rates, &of_.p_by_rates);
  }

  void AddAccel(const Stage<T>& s,
                const ForceResponse<T>& response,
                const Reading<T>& r0,
                const Reading<T>& r1) {
    of_.p_by_forces[0] += s.h * of_.v_by_forces[0] + response.p;
    of_.v_by_forces[0] += response.v;
    const T sixth = s.h * (1.0 / 6);
    for (int i = 0; i < kForceWeights; ++i) {
      const T a_0 = sixth * ForceWeights(r0)[i];
      const T a_1 = sixth * ForceWeights(r1)[i];
      const T a_m = a_0 + a_1;  // half of the weight of the middle
      Matrix3<T>& v = of_.v_by_forces[1 + i];
      of_.p_by_forces[1 + i] += s.h * v + s.h * a_0 * s.R_0 + s.h * a_m * s.R_m;
      v += a_0 * s.R_0 + 2.0 * a_m * s.R_m + a_1 * s.R_1;
    }
  }

  // Derivatives with respect to constant errors of the raw readings: those with
  // respect to the biases with the opposite sign.
  GyroResponse<T> ByGyro(const Matrix3<T>& T_g_inverse) const {
    return {of_.psi_by_rates.template leftCols<3>().lazyProduct(T_g_inverse),
            of_.v_by_rates.template leftCols<3>().lazyProduct(T_g_inverse),
            of_.p_by_rates.template leftCols<3>().lazyProduct(T_g_inverse)};
  }
  AccelResponse<T> ByAccel(const Matrix3<T>& force_by_accel) const {
    return {of_.v_by_forces[0].lazyProduct(force_by_accel),
            of_.p_by_forces[0].lazyProduct(force_by_accel)};
  }

  MotionDerivatives<T> Derivatives(const ImuModel<T>& imu,
                                   const Matrix3<T>& force_by_accel) const {
    return DerivativesOf(of_, imu, force_by_accel);
  }

 private:
  MotionResponses<T> of_;
};

}  // namespace selfcal::preintegration
