#include "core/simulation/bspline.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace selfcal {
namespace {

// Weight of the squared third differences, in values for each knot. It is small
// relative to the weakest response of the basis (0.066 squared, at half the
// frequency of the knots), so that it only affects parts without data.
constexpr double kSmoothing = 1e-5;

// The basis functions on one knot interval, u in [0, 1]: rows are control
// points, columns powers of u.
Eigen::Matrix<double, 6, 6> BasisCoefficients() {
  Eigen::Matrix<double, 6, 6> basis;
  basis << 1, -5, 10, -10, 5, -1,  //
      26, -50, 20, 20, -20, 5,     //
      66, 0, -60, 0, 30, -10,      //
      26, 50, 20, -20, -20, 10,    //
      1, 5, 10, 10, 5, -5,         //
      0, 0, 0, 0, 0, 1;
  return basis / 120;
}

}  // namespace

BSpline::BSpline(const std::vector<double>& times_s,
                 const Eigen::MatrixXd& values,
                 double duration_s,
                 double spacing_s)
    : intervals_(std::max(1L, std::lround(duration_s / spacing_s))),
      spacing_s_(duration_s / static_cast<double>(intervals_)) {
  const Eigen::Index n = intervals_ + kOrder - 1;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(times_s.size() * kOrder * kOrder +
                  16 * static_cast<std::size_t>(n));
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n, values.cols());
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    const Basis basis = BasisAt(times_s[k]);
    const auto value = values.row(static_cast<Eigen::Index>(k));
    for (int i = 0; i < kOrder; ++i) {
      right.row(basis.first + i) += basis.b0[i] * value;
      for (int j = 0; j < kOrder; ++j) {
        entries.emplace_back(
            basis.first + i, basis.first + j, basis.b0[i] * basis.b0[j]);
      }
    }
  }
  const double weight =
      kSmoothing * static_cast<double>(times_s.size()) / static_cast<double>(n);
  const std::array<double, 4> difference = {-1, 3, -3, 1};
  for (Eigen::Index k = 0; k + 3 < n; ++k) {
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        entries.emplace_back(
            k + i, k + j, weight * difference[i] * difference[j]);
      }
    }
  }
  Eigen::SparseMatrix<double> left(n, n);
  left.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(left);
  control_ = solver.solve(right);
}

BSpline::Basis BSpline::BasisAt(double t_s) const {
  static const Eigen::Matrix<double, 6, 6> kBasis = BasisCoefficients();
  const double x = t_s / spacing_s_;
  Basis basis;
  basis.first =
      std::clamp<Eigen::Index>(static_cast<Eigen::Index>(x), 0, intervals_ - 1);
  const double u = x - static_cast<double>(basis.first);
  Weights p0 = Weights::Ones();
  Weights p1 = Weights::Zero();
  Weights p2 = Weights::Zero();
  for (int n = 1; n < kOrder; ++n) {
    p0[n] = p0[n - 1] * u;
    p1[n] = n * p0[n - 1];
    p2[n] = n * p1[n - 1];
  }
  basis.b0 = kBasis * p0;
  basis.b1 = kBasis * p1 / spacing_s_;
  basis.b2 = kBasis * p2 / (spacing_s_ * spacing_s_);
  return basis;
}

BSpline::Sample BSpline::At(double t_s) const {
  const Basis basis = BasisAt(t_s);
  const auto control = control_.middleRows<kOrder>(basis.first);
  return {control.transpose() * basis.b0,
          control.transpose() * basis.b1,
          control.transpose() * basis.b2};
}

}  // namespace selfcal
