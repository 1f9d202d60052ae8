#include "server/pipeline/held_out.h"

#include "test/core/change/random_information.h"
#include "test/server/pipeline/candidate_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Of devices whose segments are as good as a reference segment each.
class HeldOutTestOfCandidates : public CandidateTest {
 protected:
  HeldOutTestOfCandidates() {
    const KnownCalibration known = FactoryKnownTo(rig_, 0.04);
    evidence_.active.theta = known.theta;
    evidence_.active.covariance = known.covariance;
    result_.theta = known.theta;
    result_.covariance = known.covariance;
    result_.track_noise_factor = 1;
  }

  // Segments of a device that is off from the factory's by `offset`, scored
  // where the candidate is: what is scored far from it is not tested.
  void HoldOut(int count, const Eigen::VectorXd& offset) {
    const Eigen::VectorXd from_candidate =
        offset - BoxMinus(result_.theta, rig_.factory);
    for (int k = 0; k < count; ++k) {
      evidence_.held_out.push_back(
          {random_.Segment(rig_, result_.theta, from_candidate), k % 2 == 0});
    }
  }

  RandomInformation random_{3};
  const Eigen::VectorXd none_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  const Eigen::VectorXd off_ = 1.9 * ReferenceSigmas(rig_);
};

TEST_F(HeldOutTestOfCandidates, AGoodOnePasses) {
  for (int trial = 0; trial < 100; ++trial) {
    evidence_.held_out.clear();
    HoldOut(8, none_);
    ASSERT_THAT(Problems(), IsEmpty()) << trial;
  }
  const HeldOutTest test = Validate().validation.held_out;
  EXPECT_EQ(test.segments, 7);
  EXPECT_EQ(test.left_out, 1);
  EXPECT_GT(test.candidate.degrees, 20);
  EXPECT_GE(test.rescored, 3);
  EXPECT_EQ(test.active.statistic, test.candidate.statistic);
}

TEST_F(HeldOutTestOfCandidates, OneFromCorruptedSegmentsIsRejectedForThat) {
  result_.theta = BoxPlus(rig_.factory, off_);
  HoldOut(8, none_);
  EXPECT_THAT(Problem("held_out_probability"), HasSubstr("held-out"));
  EXPECT_LT(Check("held_out_probability").value, 1e-4);
  const HeldOutTest test = Validate().validation.held_out;
  EXPECT_GT(test.candidate.statistic, 3 * test.active.statistic);
}

TEST_F(HeldOutTestOfCandidates, OneThatFollowsTheDevicePasses) {
  result_.theta = BoxPlus(rig_.factory, off_);
  HoldOut(8, off_);
  EXPECT_THAT(Problems(), IsEmpty());
  // Without halves that were compared it is confirmed, but weak.
  result_.halves = {};
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
}

TEST_F(HeldOutTestOfCandidates, OneBadSegmentProvesNothing) {
  HoldOut(5, none_);
  HoldOut(1, off_);
  EXPECT_THAT(Problems(), IsEmpty());
  HoldOut(5, off_);
  EXPECT_THAT(Check("held_out_probability").value, ::testing::Lt(1e-4));
}

// However badly the version before did.
TEST_F(HeldOutTestOfCandidates, OneThatIsBadButBetterIsRejected) {
  result_.theta = BoxPlus(rig_.factory, off_);
  HoldOut(8, 2.5 * off_);
  EXPECT_THAT(Problem("held_out_probability"), HasSubstr("held-out"));
}

TEST_F(HeldOutTestOfCandidates, WhatCannotBeTestedIsCountedAndNoPass) {
  HoldOut(3, none_);
  result_.theta = BoxPlus(rig_.factory, 3 * ReferenceSigmas(rig_));
  EXPECT_EQ(OutcomeOf("held_out_probability"), CheckOutcome::kNotTested);
  EXPECT_THAT(Check("held_out_probability").sentence,
              HasSubstr("None of the 3"));
  // The halves confirm it.
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  result_.halves = {};
  EXPECT_THAT(Problem("confirmed"), HasSubstr("more motion"));
  const HeldOutTest test = Validate().validation.held_out;
  EXPECT_EQ(test.segments, 0);
  EXPECT_EQ(test.left_out, 3);
  EXPECT_EQ(test.candidate.degrees, 0);
}

}  // namespace
}  // namespace selfcal::server
