#include "server/pipeline/after_change.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <vector>

namespace selfcal::server {
namespace {

// A component that is in a concerned group is concerned, whatever others it is
// in.
std::set<int> Concerned(const Rig& rig, const StoredChange& change) {
  std::set<int> concerned;
  for (const ParameterGroup& group : rig.groups) {
    if (std::count(change.groups.begin(), change.groups.end(), group.name)) {
      const std::vector<int> components = GroupComponents(rig, group);
      concerned.insert(components.begin(), components.end());
    }
  }
  return concerned;
}

}  // namespace

ThetaPrior KnownAfter(const Rig& rig,
                      const StoredChange& change,
                      const StoredCalibration& before) {
  const std::vector<int> free = FreeComponents(rig);
  const std::set<int> concerned = Concerned(rig, change);
  std::vector<int> known;
  std::set_difference(free.begin(),
                      free.end(),
                      concerned.begin(),
                      concerned.end(),
                      std::back_inserter(known));
  return MarginalPrior(rig, before.theta, before.covariance, known);
}

Eigen::MatrixXd CovarianceAfter(const Rig& rig,
                                const StoredChange& change,
                                const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  Eigen::MatrixXd after = covariance;
  for (const int i : Concerned(rig, change)) {
    after.row(i).setZero();
    after.col(i).setZero();
    after(i, i) = sigmas(i) * sigmas(i);
  }
  return after;
}

}  // namespace selfcal::server
