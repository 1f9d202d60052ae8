// Response of the motion over one step of the scheme of preintegration.h to
// changes of corrected rates and forces. Internal to core/factor.
#pragma once

#include <Eigen/Core>

#include "core/factor/imu_derivatives.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// Contribution of a step to the motion's derivatives with respect to the rates:
// through its own rotation to (psi, Delta_v, Delta_p), psi a left perturbation.
// A force rotates with its rotation, d f = psi x f.
template <typename T>
struct RateResponse {
  RateColumns<T> psi, v, p;
};

// turn_m and turn_1: from the beginning of the step to its middle and its end.
template <typename T>
RateResponse<T> RespondToRates(const Stage<T>& s,
                               const Turn<T>& turn_m,
                               const Matrix3<T>& A_m,
                               const Turn<T>& turn_1) {
  const T sixth = s.h * (1.0 / 6);
  RateResponse<T> response;
  response.psi = ByRates<T>(turn_1.LeftJacobian(s.R_0), turn_1);
  const RateColumns<T> middle =
      ByRates<T>(Cross<T, 3>(-4.0 * sixth * s.f_m, A_m), turn_m);
  response.v = middle - Cross<T, kRateChanges>(sixth * s.f_1, response.psi);
  response.p = 0.5 * s.h * middle;
  return response;
}

// Contribution of a step to velocity and position for a constant force in the
// body.
template <typename T>
struct ForceResponse {
  Matrix3<T> v, p;
};

template <typename T>
ForceResponse<T> RespondToForce(const Stage<T>& s) {
  const T sixth = s.h * (1.0 / 6);
  return {sixth * (s.R_0 + 4.0 * s.R_m + s.R_1),
          sixth * s.h * (s.R_0 + 2.0 * s.R_m)};
}

}  // namespace selfcal::preintegration
