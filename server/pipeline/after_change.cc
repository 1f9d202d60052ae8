#include "server/pipeline/after_change.h"

#include <algorithm>
#include <iterator>

#include "core/change/concerned.h"
#include "core/change/group_concern.h"

namespace selfcal::server {

namespace {

Eigen::MatrixXd LessCertain(const Rig& rig,
                            const StoredChange& change,
                            const StoredCalibration& before,
                            std::span<const SegmentInformation> since) {
  KnownCalibration known{before.theta, before.covariance};
  if (before.report) {
    known.track_noise_factor = before.report->track_noise_factor;
  }
  return before.covariance +
         DoubtOfUnconcerned(rig, known, since, change.groups);
}

}  // namespace

ThetaPrior KnownAfter(const Rig& rig,
                      const StoredChange& change,
                      const StoredCalibration& before,
                      std::span<const SegmentInformation> since) {
  return MarginalPrior(rig,
                       before.theta,
                       LessCertain(rig, change, before, since),
                       UnconcernedComponents(rig, change.groups));
}

Eigen::MatrixXd CovarianceAfter(const Rig& rig,
                                const StoredChange& change,
                                const StoredCalibration& before,
                                std::span<const SegmentInformation> since) {
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  Eigen::MatrixXd after = LessCertain(rig, change, before, since);
  for (const int i : ConcernedComponents(rig, change.groups)) {
    after.row(i).setZero();
    after.col(i).setZero();
    after(i, i) = sigmas(i) * sigmas(i);
  }
  return after;
}

std::vector<std::string> ChangingGroups(
    const StoredChange& newest, const std::optional<StoredChange>& earlier) {
  if (newest.kind == ChangeKind::kDrift) return newest.groups;
  std::vector<std::string> again;
  if (!earlier) return again;
  std::copy_if(newest.groups.begin(),
               newest.groups.end(),
               std::back_inserter(again),
               [&](const std::string& group) {
                 return std::count(earlier->groups.begin(),
                                   earlier->groups.end(),
                                   group) > 0;
               });
  return again;
}

}  // namespace selfcal::server
