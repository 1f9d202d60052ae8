#include "core/verify/compare_scores.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool IsComparable(const SegmentInformation& a,
                  const SegmentInformation& b,
                  Eigen::Index size) {
  const auto has_shape = [&](const SegmentInformation& s) {
    return s.Lambda.rows() == size && s.Lambda.cols() == size &&
           s.eta.size() == size && s.Lambda.allFinite() && s.eta.allFinite();
  };
  return has_shape(a) && has_shape(b) && a.groups.size() == b.groups.size();
}

}  // namespace

ScoreDifference CompareScores(const Rig& rig,
                              const SegmentInformation& a,
                              const SegmentInformation& b) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  if (!IsComparable(a, b, prior.size())) {
    return {kInfinity, kInfinity, kInfinity, 0};
  }
  ScoreDifference difference;
  const bool observed =
      std::min(a.rank, b.rank) == static_cast<int>(free.size());
  difference.tolerance = observed ? kScoreTolerance : kUnobservedScoreTolerance;
  for (std::size_t q = 0; q < a.groups.size(); ++q) {
    const double by = std::abs(a.groups[q].entropy - b.groups[q].entropy);
    // An entropy that is NaN is a difference.
    difference.entropy_nats =
        std::max(difference.entropy_nats, std::isnan(by) ? kInfinity : by);
  }
  if (free.empty()) return difference;
  // Scaled to units of the prior, which adds 1 in each direction.
  const Eigen::VectorXd unit = prior(free);
  const auto posterior = [&](const SegmentInformation& s) {
    Eigen::MatrixXd P =
        unit.asDiagonal() * s.Lambda(free, free) * unit.asDiagonal();
    P.diagonal().array() += 1;
    return P;
  };
  const Eigen::MatrixXd A = posterior(a);
  const Eigen::MatrixXd B = posterior(b);
  const Eigen::LLT<Eigen::MatrixXd> root(A);
  if (root.info() != Eigen::Success) {
    return {kInfinity, kInfinity, kInfinity, 0};
  }
  // L^-1 (B - A) L^-T with A = L L^T.
  Eigen::MatrixXd by = root.matrixL().solve(B - A);
  by = root.matrixL().solve(by.transpose().eval());
  difference.information =
      SymmetricEigenvalues(0.5 * (by + by.transpose())).cwiseAbs().maxCoeff();
  const Eigen::VectorXd step = root.solve(unit.cwiseProduct(a.eta(free)));
  const Eigen::VectorXd other = B.ldlt().solve(unit.cwiseProduct(b.eta(free)));
  difference.estimate_sigmas =
      (root.matrixL().transpose() * (other - step)).norm();
  return difference;
}

bool IsRounding(const ScoreDifference& difference) {
  return difference.entropy_nats <= difference.tolerance &&
         difference.information <= difference.tolerance &&
         difference.estimate_sigmas <= difference.tolerance;
}

}  // namespace selfcal
