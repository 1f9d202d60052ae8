#include "core/calibration/theta_prior.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <iterator>

namespace selfcal {

ThetaPrior FactoryPrior(const Rig& rig) {
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  ThetaPrior prior{PriorMean(rig),
                   Eigen::MatrixXd::Zero(sigmas.size(), sigmas.size())};
  for (const int i : FreeComponents(rig)) {
    prior.information(i, i) = 1 / (sigmas(i) * sigmas(i));
  }
  return prior;
}

ThetaPrior MarginalPrior(const Rig& rig,
                         const Calibration& theta,
                         const Eigen::MatrixXd& covariance,
                         const std::vector<int>& components) {
  const std::vector<int> free = FreeComponents(rig);
  std::vector<int> known;
  std::set_intersection(free.begin(),
                        free.end(),
                        components.begin(),
                        components.end(),
                        std::back_inserter(known));
  ThetaPrior prior{theta,
                   Eigen::MatrixXd::Zero(covariance.rows(), covariance.cols())};
  if (known.empty()) return prior;
  // Scaled to units of the rig's prior: those of the components differ by
  // orders of magnitude.
  const Eigen::VectorXd scale = PriorSigmas(rig)(known).cwiseInverse();
  const Eigen::MatrixXd normalised =
      scale.asDiagonal() * covariance(known, known) * scale.asDiagonal();
  const Eigen::MatrixXd inverse = normalised.ldlt().solve(
      Eigen::MatrixXd::Identity(normalised.rows(), normalised.cols()));
  prior.information(known, known) = scale.asDiagonal() *
                                    ((inverse + inverse.transpose()) / 2) *
                                    scale.asDiagonal();
  return prior;
}

}  // namespace selfcal
