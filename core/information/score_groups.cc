#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/information/segment_information.h"
#include "core/information/unobserved.h"

namespace selfcal {
namespace {

// Less information than this part of the prior's, a sigma over a thousand times
// the prior's, is none: the entropy without a prior does not exist there.
constexpr double kUndetermined = 1e-6;
// A group is determined if it has no larger share in an undetermined direction.
constexpr double kShare = 1e-6;

// 1/2 ln det of a symmetric positive definite matrix.
double HalfLogDet(const Eigen::MatrixXd& matrix) {
  const Eigen::LLT<Eigen::MatrixXd> llt(matrix);
  return llt.matrixLLT().diagonal().array().log().sum();
}

Eigen::MatrixXd Inverse(const Eigen::MatrixXd& matrix) {
  const auto identity = Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols());
  const Eigen::MatrixXd inverse =
      Eigen::LLT<Eigen::MatrixXd>(matrix).solve(identity);
  return 0.5 * (inverse + inverse.transpose());
}

// The free components of a rig, and Lambda over them in units of the prior.
struct NormalisedInformation {
  NormalisedInformation(const Rig& rig, const Eigen::MatrixXd& Lambda)
      : free(FreeComponents(rig)),
        prior(PriorSigmas(rig)),
        reference(ReferenceSigmas(rig)) {
    const Eigen::VectorXd scale = prior(free);
    information = (scale * scale.transpose()).cwiseProduct(Lambda(free, free));
    for (const TangentComponent& component : TangentComponents(rig.factory)) {
      names.push_back(component.name);
    }
  }

  // Positions of a group's components among the free ones.
  std::vector<int> Positions(const std::vector<int>& components) const {
    std::vector<int> positions;
    for (const int component : components) {
      const auto at = std::lower_bound(free.begin(), free.end(), component);
      positions.push_back(static_cast<int>(at - free.begin()));
    }
    return positions;
  }

  std::vector<int> free;
  Eigen::VectorXd prior;      // of all components
  Eigen::VectorXd reference;  // of all components
  Eigen::MatrixXd information;
  std::vector<std::string> names;  // of all components
};

// Entropy of a covariance in units of the prior, normalised by sigma_ref.
double NormalisedEntropy(const Eigen::MatrixXd& covariance,
                         const Eigen::VectorXd& prior,
                         const Eigen::VectorXd& reference) {
  return Entropy(covariance, reference.cwiseQuotient(prior));
}

GroupScore ScoreGroup(const NormalisedInformation& normalised,
                      const Eigen::MatrixXd& posterior,
                      const std::string& name,
                      const std::vector<int>& components) {
  GroupScore score;
  score.group = name;
  score.size = static_cast<int>(components.size());
  if (components.empty()) return score;
  const std::vector<int> at = normalised.Positions(components);
  const Eigen::MatrixXd covariance = posterior(at, at);
  score.entropy = NormalisedEntropy(covariance,
                                    normalised.prior(components),
                                    normalised.reference(components));
  score.gain = std::max(0.0, -HalfLogDet(covariance));
  std::vector<std::string> names;
  for (const int component : components) {
    names.push_back(normalised.names[component]);
  }
  const Eigen::MatrixXd gained =
      Inverse(covariance) - Eigen::MatrixXd::Identity(score.size, score.size);
  Observability observability = AnalyseObservability(gained, names);
  score.rank = observability.rank;
  score.unobserved = std::move(observability.unobserved);
  return score;
}

}  // namespace

double Entropy(const Eigen::MatrixXd& Sigma, const Eigen::VectorXd& sigma_ref) {
  const Eigen::VectorXd scale = sigma_ref.cwiseInverse();
  const double k = static_cast<double>(Sigma.rows());
  return k / 2 * std::log(2 * std::numbers::pi * std::numbers::e) +
         HalfLogDet(scale.asDiagonal() * Sigma * scale.asDiagonal());
}

std::vector<GroupScore> ScoreGroups(const Rig& rig,
                                    const Eigen::MatrixXd& Lambda) {
  const NormalisedInformation normalised(rig, Lambda);
  const auto size = normalised.information.rows();
  const Eigen::MatrixXd posterior =
      Inverse(normalised.information + Eigen::MatrixXd::Identity(size, size));
  std::vector<GroupScore> scores;
  for (const ParameterGroup& group : rig.groups) {
    scores.push_back(ScoreGroup(
        normalised, posterior, group.name, GroupComponents(rig, group)));
  }
  return scores;
}

std::vector<std::optional<double>> EntropiesWithoutPrior(
    const Rig& rig, const Eigen::MatrixXd& Lambda) {
  const NormalisedInformation normalised(rig, Lambda);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      normalised.information);
  const auto null = (eigen.eigenvalues().array() < kUndetermined).count();
  const auto seen = eigen.eigenvalues().size() - null;
  std::vector<std::optional<double>> entropies;
  for (const ParameterGroup& group : rig.groups) {
    const std::vector<int> components = GroupComponents(rig, group);
    const std::vector<int> at = normalised.Positions(components);
    const Eigen::MatrixXd U = eigen.eigenvectors()(at, Eigen::all);
    if (components.empty() ||
        (null > 0 && U.leftCols(null).cwiseAbs().maxCoeff() > kShare)) {
      entropies.push_back(std::nullopt);
      continue;
    }
    const Eigen::MatrixXd root =
        U.rightCols(seen) *
        eigen.eigenvalues().tail(seen).cwiseSqrt().cwiseInverse().asDiagonal();
    entropies.push_back(NormalisedEntropy(root * root.transpose(),
                                          normalised.prior(components),
                                          normalised.reference(components)));
  }
  return entropies;
}

}  // namespace selfcal
