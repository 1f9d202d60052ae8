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

// Carries derivatives over a step, and adds its own response.
template <typename T, int cols, class Response>
void PropagateColumns(const Stage<T>& s,
                      const Response& response,
                      Eigen::Matrix<T, 3, cols>* psi,
                      Eigen::Matrix<T, 3, cols>* v,
                      Eigen::Matrix<T, 3, cols>* p) {
  for (int c = 0; c < cols; ++c) {
    const Vector3<T> psi_0 = psi->col(c);
    const Vector3<T> v_0 = v->col(c);
    p->col(c) += s.h * v_0 - s.dp.cross(psi_0) + response.p.col(c);
    v->col(c) = v_0 - s.dv.cross(psi_0) + response.v.col(c);
    psi->col(c) = psi_0 + response.psi.col(c);
  }
}

template <typename T>
ForceResponse<T> RespondToForce(const Stage<T>& s) {
  const T sixth = s.h * (1.0 / 6);
  return {sixth * (s.R_0 + 4.0 * s.R_m + s.R_1),
          sixth * s.h * (s.R_0 + 2.0 * s.R_m)};
}

}  // namespace selfcal::preintegration
