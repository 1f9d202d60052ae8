#include "core/verify/compare_scores.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

class CompareScoresTest : public testing::Test {
 protected:
  const Rig rig_ = HandheldRig("handheld");
  const SegmentInformation score_ =
      ScoreSegment(rig_, rig_.factory, MovingSegment(rig_, 1));

  void ScoreGroupsOf(SegmentInformation* score) {
    score->groups = ScoreGroups(rig_, score->Lambda);
  }
};

TEST_F(CompareScoresTest, AScoreDoesNotDifferFromItself) {
  const ScoreDifference difference = CompareScores(rig_, score_, score_);
  EXPECT_EQ(difference.entropy_nats, 0);
  EXPECT_LT(difference.information, 1e-12);
  EXPECT_LT(difference.estimate_sigmas, 1e-9);
  EXPECT_TRUE(IsRounding(difference));
}

// If the data dominates the prior, an increase of its information by a
// thousandth is one of the posterior, and changes an entropy by at most half of
// that for each component.
TEST_F(CompareScoresTest, ReportsTheRelativeDifferenceOfInformation) {
  SegmentInformation more = score_;
  more.Lambda *= 1 + 1e-3;
  ScoreGroupsOf(&more);
  const ScoreDifference difference = CompareScores(rig_, score_, more);
  EXPECT_NEAR(difference.information, 1e-3, 1e-5);
  int largest = 0;
  for (const GroupScore& group : score_.groups) {
    largest = std::max(largest, group.size);
  }
  EXPECT_GT(difference.entropy_nats, 1e-4);
  EXPECT_LE(difference.entropy_nats, 1e-3 * largest / 2);
  EXPECT_FALSE(IsRounding(difference));
}

TEST_F(CompareScoresTest, DetectsADifferentEstimate) {
  SegmentInformation other = score_;
  const Eigen::VectorXd prior = PriorSigmas(rig_);
  // The gradient of an estimate that has moved by one in the prior's units.
  Eigen::VectorXd d = Eigen::VectorXd::Zero(prior.size());
  d(0) = prior(0);
  Eigen::MatrixXd posterior = score_.Lambda;
  posterior.diagonal() += prior.cwiseAbs2().cwiseInverse();
  other.eta += posterior * d;
  const double sigmas = std::sqrt(d.dot(posterior * d));
  const ScoreDifference difference = CompareScores(rig_, score_, other);
  EXPECT_NEAR(difference.estimate_sigmas, sigmas, 1e-6 * sigmas);
  EXPECT_FALSE(IsRounding(difference));
}

TEST_F(CompareScoresTest, WhatIsNotANumberOrNotOfTheRigDiffers) {
  SegmentInformation broken = score_;
  broken.eta(3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsRounding(CompareScores(rig_, score_, broken)));
  broken = score_;
  broken.groups[0].entropy = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsRounding(CompareScores(rig_, score_, broken)));
  broken = score_;
  broken.Lambda = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_FALSE(IsRounding(CompareScores(rig_, score_, broken)));
}

}  // namespace
}  // namespace selfcal
