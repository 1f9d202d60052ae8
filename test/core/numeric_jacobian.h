// Numeric derivatives with which tests compare analytic Jacobians.
#pragma once

#include <Eigen/Core>

namespace selfcal {

// d f(delta) / d delta at delta = 0, by central differences of fourth order.
// `f` maps a perturbation, an Eigen::VectorXd of n entries around zero, to an
// Eigen::VectorXd of always the same size. The error is of the order of
// step^4 |f'''''| + epsilon |f| / step.
template <class F>
Eigen::MatrixXd NumericJacobian(const F& f, int n, double step = 1e-6) {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < n; ++i) {
    const auto at = [&](double steps) -> Eigen::VectorXd {
      delta[i] = steps * step;
      return f(delta);
    };
    const Eigen::VectorXd near = at(1) - at(-1);
    const Eigen::VectorXd far = at(2) - at(-2);
    delta[i] = 0;
    if (i == 0) jacobian.resize(near.size(), n);
    jacobian.col(i) = (8 * near - far) / (12 * step);
  }
  return jacobian;
}

}  // namespace selfcal
