#include "server/pipeline/after_change.h"

#include "core/change/concerned.h"

namespace selfcal::server {

ThetaPrior KnownAfter(const Rig& rig,
                      const StoredChange& change,
                      const StoredCalibration& before) {
  return MarginalPrior(rig,
                       before.theta,
                       before.covariance,
                       UnconcernedComponents(rig, change.groups));
}

Eigen::MatrixXd CovarianceAfter(const Rig& rig,
                                const StoredChange& change,
                                const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  Eigen::MatrixXd after = covariance;
  for (const int i : ConcernedComponents(rig, change.groups)) {
    after.row(i).setZero();
    after.col(i).setZero();
    after(i, i) = sigmas(i) * sigmas(i);
  }
  return after;
}

}  // namespace selfcal::server
