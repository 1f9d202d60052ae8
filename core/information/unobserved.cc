#include "core/information/unobserved.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

constexpr double kObserved = 1.0;
constexpr double kPartsOfSquare = 0.9;
// Diagonal entries of a projector that differ by less are treated as equal, and
// the first component is chosen, so that rounding does not decide.
constexpr double kTie = 1e-6;

int FirstLargest(const Eigen::VectorXd& values) {
  const double largest = values.maxCoeff();
  int i = 0;
  while (values(i) < largest - kTie) ++i;
  return i;
}

// Orthonormal basis of the span of the columns of U: Cholesky with pivoting of
// the projector U U^T, whose columns are the unit vectors projected on the
// span.
std::vector<Eigen::VectorXd> AlignedBasis(const Eigen::MatrixXd& U) {
  Eigen::MatrixXd projector = U * U.transpose();
  std::vector<Eigen::VectorXd> basis;
  for (int n = 0; n < U.cols(); ++n) {
    const int i = FirstLargest(projector.diagonal());
    const Eigen::VectorXd d = projector.col(i).normalized();
    projector -= d * d.transpose();
    basis.push_back(d);
  }
  return basis;
}

}  // namespace

UnobservedDirection DescribeDirection(const Eigen::VectorXd& direction,
                                      std::span<const std::string> names,
                                      double information_ratio) {
  std::vector<int> order(direction.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::abs(direction(a)) > std::abs(direction(b));
  });
  const double sign = direction(order.front()) < 0 ? -1 : 1;
  UnobservedDirection result;
  result.information_ratio = information_ratio;
  double square = 0;
  for (const int i : order) {
    if (square >= kPartsOfSquare * direction.squaredNorm()) break;
    result.parts.push_back({names[i], sign * direction(i)});
    square += direction(i) * direction(i);
  }
  return result;
}

Observability AnalyseObservability(const Eigen::MatrixXd& information,
                                   std::span<const std::string> names) {
  const SymmetricEigen eigen(information);
  const auto weak = (eigen.eigenvalues().array() < kObserved).count();
  Observability result;
  result.rank = static_cast<int>(information.rows() - weak);
  // Eigenvalues ascend.
  for (const Eigen::VectorXd& d :
       AlignedBasis(eigen.eigenvectors().leftCols(weak))) {
    const double ratio = d.dot(information * d);
    result.unobserved.push_back(DescribeDirection(
        d, names, std::clamp(ratio, 0.0, std::nextafter(kObserved, 0))));
  }
  return result;
}

}  // namespace selfcal
