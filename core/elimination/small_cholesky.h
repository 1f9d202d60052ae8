// Cholesky factor of a small information matrix that is positive definite by
// construction but may have lost that to rounding.
//
// A pivot is accurate to the rounding of its diagonal entry. If it is below
// kPivotFloor of that, it is raised to that value: the direction gets the least
// information that is distinguishable from none, rather than a NaN or a random
// large variance. Well conditioned problems are not affected.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace selfcal {

inline constexpr double kPivotFloor = 1e-14;

// Overwrites the lower triangle of *matrix (the upper is not read) by L with L
// L^T = matrix. A direction without any information gets a unit pivot, which
// eliminates nothing.
template <int N>
void GuardedCholesky(Eigen::Matrix<double, N, N>* matrix) {
  Eigen::Matrix<double, N, N>& L = *matrix;
  for (int j = 0; j < N; ++j) {
    const double mass = L(j, j);
    double pivot = mass;
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k);
    const double floor = mass > 0 ? kPivotFloor * mass : 1.0;
    const double diagonal = std::sqrt(std::max(pivot, floor));
    L(j, j) = diagonal;
    for (int i = j + 1; i < N; ++i) {
      double sum = L(i, j);
      for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
      L(i, j) = sum / diagonal;
    }
  }
}

}  // namespace selfcal
