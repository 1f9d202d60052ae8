#include "server/pipeline/after_change.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal::server {
namespace {

TEST(AfterChange, OnlyWhatIsNotConcernedStaysKnown) {
  Rig rig = HandheldRig("a");
  // Overlaps with extrinsics.
  rig.groups.push_back({"position", {"*.p_CI.*"}});
  StoredCalibration before;
  before.theta = rig.factory;
  // What the rig holds fixed, the camera's time offset, has no variance.
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd known = 0.2 * ReferenceSigmas(rig);
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(known.size());
  variances(free) = known(free).cwiseAbs2();
  before.covariance = variances.asDiagonal();
  StoredChange change;
  change.groups = {"extrinsics"};
  // Two segments that show the calibration from before to be right.
  std::vector<SegmentInformation> since(2);
  for (SegmentInformation& information : since) {
    information.theta0 = rig.factory;
    information.Lambda = Eigen::MatrixXd::Zero(known.size(), known.size());
    information.Lambda(free, free) =
        ReferenceSigmas(rig)(free).cwiseAbs2().cwiseInverse().asDiagonal();
    information.eta = Eigen::VectorXd::Zero(known.size());
  }
  const ThetaPrior prior = KnownAfter(rig, change, before, since);
  const Eigen::MatrixXd covariance =
      CovarianceAfter(rig, change, before, since);
  const auto components = TangentComponents(rig.factory);
  const std::vector<int> concerned =
      MatchComponents(components, {"*.q_CI.*", "*.p_CI.*"});
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  for (int i = 0; i < static_cast<int>(components.size()); ++i) {
    const double variance = before.covariance(i, i);
    if (std::count(concerned.begin(), concerned.end(), i) > 0) {
      EXPECT_EQ(prior.information(i, i), 0) << components[i].name;
      EXPECT_DOUBLE_EQ(covariance(i, i), sigmas(i) * sigmas(i));
    } else if (std::count(free.begin(), free.end(), i) == 0) {
      EXPECT_EQ(prior.information(i, i), 0) << components[i].name;
      EXPECT_EQ(covariance(i, i), 0) << components[i].name;
    } else {
      // The change may concern it all the same, by what the segments do not
      // show: some tenths of a reference sigma.
      const double reference = ReferenceSigmas(rig)(i);
      EXPECT_GT(covariance(i, i), variance + std::pow(0.05 * reference, 2));
      EXPECT_LT(covariance(i, i), variance + std::pow(0.7 * reference, 2));
      EXPECT_LE(prior.information(i, i) * variance, 1) << components[i].name;
      EXPECT_GT(prior.information(i, i), 0) << components[i].name;
    }
  }
}

TEST(AfterChange, ADriftAndWhatChangesAgainMayGoOn) {
  StoredChange newest;
  newest.groups = {"camera", "extrinsics"};
  EXPECT_THAT(ChangingGroups(newest, std::nullopt), ::testing::IsEmpty());
  StoredChange earlier;
  earlier.kind = ChangeKind::kDrift;
  earlier.groups = {"imu", "extrinsics"};
  EXPECT_THAT(ChangingGroups(newest, earlier),
              ::testing::ElementsAre("extrinsics"));
  newest.kind = ChangeKind::kDrift;
  EXPECT_THAT(ChangingGroups(newest, std::nullopt),
              ::testing::ElementsAre("camera", "extrinsics"));
}

}  // namespace
}  // namespace selfcal::server
