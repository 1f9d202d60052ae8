#include "core/change/heterogeneity.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/model/median.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {

Heterogeneity::Heterogeneity(std::span<const OffsetInformation> segments) {
  for (const OffsetInformation& segment : segments) {
    const SymmetricEigen eigen(segment.Lambda);
    const auto count = (eigen.eigenvalues().array() >= kObserved).count();
    const Eigen::MatrixXd U = eigen.eigenvectors().rightCols(count);
    const Eigen::VectorXd sigmas =
        eigen.eigenvalues().tail(count).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd whitening = sigmas.asDiagonal() * U.transpose();
    segments_.push_back({whitening * segment.Lambda, whitening * segment.eta});
  }
}

double Heterogeneity::Of(const Eigen::VectorXd& weights,
                         const Course& course,
                         const Eigen::MatrixXd& B) const {
  const OffsetInformation change = course.Change();
  Eigen::MatrixXd posterior = B.transpose() * change.Lambda * B;
  posterior.diagonal().array() += 1;
  const Eigen::VectorXd x =
      B * posterior.llt().solve(B.transpose() * change.eta);
  const Eigen::VectorXd before = course.Offset(x, 0);
  std::vector<double> all, after;
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Whitened& segment = segments_[i];
    if (segment.values.size() == 0) continue;
    const double weight = weights(static_cast<Eigen::Index>(i));
    const double ratio =
        (segment.values - segment.by_offset * (before + weight * x))
            .squaredNorm() /
        static_cast<double>(segment.values.size());
    all.push_back(ratio);
    if (weight > 0) after.push_back(ratio);
  }
  return std::max({1.0, UpperMedian(all), UpperMedian(after)});
}

}  // namespace selfcal
