#include "server/pipeline/after_change.h"

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

}  // namespace selfcal::server
