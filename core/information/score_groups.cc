#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/information/group_scorer.h"
#include "core/information/segment_information.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// Information below this fraction of the prior's, a sigma over a thousand times
// the prior's, is treated as none: the entropy without a prior does not exist.
constexpr double kUndetermined = 1e-6;
// A group is determined if its share in every undetermined direction is at most
// this.
constexpr double kShare = 1e-6;

// 1/2 ln det of a symmetric positive definite matrix.
double HalfLogDet(const Eigen::MatrixXd& matrix) {
  DefiniteMatrix definite;
  definite.Factor(matrix);
  return definite.HalfLogDet();
}

double Constant(std::size_t k) {
  return static_cast<double>(k) / 2 *
         std::log(2 * std::numbers::pi * std::numbers::e);
}

// Information of the free components, in units of the prior.
Eigen::MatrixXd Normalise(const RigComponents& components,
                          const Eigen::MatrixXd& Lambda) {
  const std::vector<int>& free = components.free();
  const Eigen::VectorXd scale = components.prior()(free);
  return (scale * scale.transpose()).cwiseProduct(Lambda(free, free));
}

}  // namespace

const Eigen::MatrixXd& DefiniteMatrix::Inverse() {
  inverse_.setIdentity(llt_.rows(), llt_.cols());
  llt_.solveInPlace(inverse_);
  symmetric_ = inverse_.transpose();
  symmetric_ = 0.5 * (symmetric_ + inverse_);
  return symmetric_;
}

void GroupScorer::Observe(const Eigen::MatrixXd& information,
                          std::span<const std::string> names,
                          int* rank,
                          std::vector<UnobservedDirection>* unobserved,
                          DefiniteMatrix* workspace) {
  unobserved->clear();
  *rank = static_cast<int>(information.rows());
  // All eigenvalues are above 1 if and only if this is positive definite.
  const auto one = Eigen::MatrixXd::Identity(*rank, *rank);
  if (workspace->Factor(information - one)) return;
  Observability observability = AnalyseObservability(information, names);
  *rank = observability.rank;
  *unobserved = std::move(observability.unobserved);
}

void GroupScorer::Score(const RigComponents& components,
                        const Eigen::MatrixXd& information,
                        std::vector<GroupScore>* scores) {
  const std::vector<RigComponents::Group>& groups = components.groups();
  groups_.resize(groups.size());
  scores->resize(groups.size());
  posterior_.Factor(information + Eigen::MatrixXd::Identity(
                                      information.rows(), information.cols()));
  const Eigen::MatrixXd& posterior = posterior_.Inverse();
  for (std::size_t q = 0; q < groups.size(); ++q) {
    const RigComponents::Group& group = groups[q];
    GroupWorkspace& workspace = groups_[q];
    GroupScore& score = (*scores)[q];
    score.group = group.name;
    score.size = static_cast<int>(group.at.size());
    score.entropy = 0;
    score.gain = 0;
    score.rank = 0;
    score.unobserved.clear();
    if (group.at.empty()) continue;
    workspace.covariance.resize(score.size, score.size);
    for (int i = 0; i < score.size; ++i) {
      for (int j = 0; j < score.size; ++j) {
        workspace.covariance(i, j) = posterior(group.at[i], group.at[j]);
      }
    }
    workspace.posterior.Factor(workspace.covariance);
    const double half_log_det = workspace.posterior.HalfLogDet();
    score.entropy = Constant(group.at.size()) + half_log_det + group.log_scale;
    score.gain = std::max(0.0, -half_log_det);
    workspace.gained = workspace.posterior.Inverse();
    workspace.gained.diagonal().array() -= 1;
    Observe(workspace.gained,
            group.names,
            &score.rank,
            &score.unobserved,
            &workspace.observed);
  }
}

double Entropy(const Eigen::MatrixXd& Sigma, const Eigen::VectorXd& sigma_ref) {
  const Eigen::VectorXd scale = sigma_ref.cwiseInverse();
  return Constant(Sigma.rows()) +
         HalfLogDet(scale.asDiagonal() * Sigma * scale.asDiagonal());
}

std::vector<GroupScore> ScoreGroups(const Rig& rig,
                                    const Eigen::MatrixXd& Lambda) {
  const RigComponents components(rig);
  std::vector<GroupScore> scores;
  GroupScorer().Score(components, Normalise(components, Lambda), &scores);
  return scores;
}

std::vector<std::optional<double>> EntropiesWithoutPrior(
    const Rig& rig, const Eigen::MatrixXd& Lambda) {
  const RigComponents components(rig);
  const SymmetricEigen eigen(Normalise(components, Lambda));
  const auto null = (eigen.eigenvalues().array() < kUndetermined).count();
  const auto seen = eigen.eigenvalues().size() - null;
  std::vector<std::optional<double>> entropies;
  for (const RigComponents::Group& group : components.groups()) {
    const Eigen::MatrixXd U = eigen.eigenvectors()(group.at, Eigen::all);
    if (group.at.empty() ||
        (null > 0 && U.leftCols(null).cwiseAbs().maxCoeff() > kShare)) {
      entropies.push_back(std::nullopt);
      continue;
    }
    const Eigen::MatrixXd root =
        U.rightCols(seen) *
        eigen.eigenvalues().tail(seen).cwiseSqrt().cwiseInverse().asDiagonal();
    entropies.push_back(Constant(group.at.size()) +
                        HalfLogDet(root * root.transpose()) + group.log_scale);
  }
  return entropies;
}

}  // namespace selfcal
