#include "server/pipeline/verdict.h"

#include "test/server/pipeline/candidate_fixture.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST_F(CandidateTest, WhatIsHeldOrHardlyLearnedIsWeak) {
  result_.held_constant = {{{{"cam0.p_CI.z", -0.8}}, 0.3}};
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
  EXPECT_THAT(TheVerdict().sentences,
              ElementsAre(HasSubstr("-0.80 cam0.p_CI.z")));
  result_.held_constant.clear();
  evidence_.active.covariance = PriorSigmas(rig_).cwiseAbs2().asDiagonal();
  const double prior = PriorSigmas(rig_)[5];
  result_.covariance(5, 5) = 0.36 * prior * prior;
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
  EXPECT_THAT(TheVerdict().sentences,
              ElementsAre(HasSubstr(TangentComponents(rig_.factory)[5].name)));
}

TEST_F(CandidateTest, AShiftByWhatIsNotEstimatedIsWeak) {
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
  evidence_.effects = {
      {{"cam0.time_offset", {90, 1, 1e-20}, 1.6, "cam0.q_CI.x"}}};
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kWeak);
  EXPECT_THAT(TheVerdict().sentences,
              ElementsAre(HasSubstr("cam0.time_offset")));
  evidence_.effects->front().bias_sigmas = 0.9;
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kGood);
}

TEST_F(CandidateTest, TheVerdictOnWhatIsRejectedIsTheReasons) {
  result_.rank = 3;
  EXPECT_EQ(TheVerdict().kind, VerdictKind::kNotTrustworthy);
  EXPECT_EQ(TheVerdict().sentences, Problems());
}

TEST(VerdictTest, ThatOfAVersionIsTheStoredOne) {
  StoredCalibration version;
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kFactory);
  version.run = 3;
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kUnknown);
  EXPECT_THAT(VerdictOf(version).sentences, ElementsAre(HasSubstr("before")));
  version.verdict = {VerdictKind::kGood, {"noted"}};
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kGood);
  EXPECT_THAT(VerdictOf(version).sentences, ElementsAre("noted"));
  version.finding = "The two cores disagree.";
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kNotTrustworthy);
  EXPECT_THAT(VerdictOf(version).sentences,
              ElementsAre("The two cores disagree."));
  version.finding.clear();
  version.changed_since = 2;
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kNotTrustworthy);
  EXPECT_THAT(VerdictOf(version).sentences, ElementsAre(HasSubstr("change 2")));
  // It described the device before.
  version.state = CalibrationState::kSuperseded;
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kGood);
  // The store rejects what no longer holds, whatever was found before.
  version.state = CalibrationState::kRejected;
  version.reasons = {"The device has changed."};
  EXPECT_EQ(VerdictOf(version).kind, VerdictKind::kNotTrustworthy);
  EXPECT_EQ(VerdictOf(version).sentences, version.reasons);
}

}  // namespace
}  // namespace selfcal::server
