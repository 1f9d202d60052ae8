#include "client/report/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test/client/report/report_fixture.h"

namespace selfcal::client {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Verdict, IsGoodWhereAllWasLearnedAndTheRestAgrees) {
  const Verdict verdict = Judge(AVersion(2, 0.01), AVersion(1, 1));
  EXPECT_EQ(verdict.kind, VerdictKind::kGood);
  EXPECT_THAT(verdict.sentences, Contains(HasSubstr("3 segments")));
}

TEST(Verdict, IsWeakWhereSigmaHardlyCameDown) {
  v1::Calibration calibration = AVersion(2, 0.01);
  calibration.mutable_estimates(1)->set_sigma(0.8);
  const Verdict verdict = Judge(calibration, AVersion(1, 1));
  EXPECT_EQ(verdict.kind, VerdictKind::kWeak);
  EXPECT_THAT(verdict.sentences,
              Contains(HasSubstr("Hardly learned: imu.gyro.scale.x")));
  EXPECT_THAT(verdict.sentences, Not(Contains(HasSubstr("cam0.focal.x"))));
}

TEST(Verdict, IsWeakWhereADirectionWasHeld) {
  v1::Calibration calibration = AVersion(2, 0.01);
  auto* part = calibration.mutable_solver()->add_held_constant()->add_parts();
  part->set_component("cam0.p_CI.z");
  part->set_weight(1);
  const Verdict verdict = Judge(calibration, AVersion(1, 1));
  EXPECT_EQ(verdict.kind, VerdictKind::kWeak);
  EXPECT_THAT(verdict.sentences, Contains(HasSubstr("cam0.p_CI.z")));
}

TEST(Verdict, IsInconsistentWhereHeldOutSegmentsDisagreeEvenIfWeak) {
  v1::Calibration calibration = AVersion(2, 0.9);
  calibration.mutable_validation()->mutable_held_out()->set_probability(1e-6);
  EXPECT_EQ(Judge(calibration, AVersion(1, 1)).kind,
            VerdictKind::kInconsistent);
}

TEST(Verdict, SaysWhereNothingTestedIt) {
  v1::Calibration calibration = AVersion(2, 0.01);
  calibration.mutable_validation()->clear_held_out();
  const Verdict verdict = Judge(calibration, AVersion(1, 1));
  EXPECT_EQ(verdict.kind, VerdictKind::kUntested);
  EXPECT_THAT(verdict.sentences, Contains(HasSubstr("No segment was held")));
}

TEST(Verdict, OfARejectedVersionIsItsReasons) {
  v1::Calibration calibration = AVersion(2, 0.01);
  calibration.set_state(v1::Calibration::REJECTED);
  calibration.add_reasons("held-out segments fit worse");
  const Verdict verdict = Judge(calibration, AVersion(1, 1));
  EXPECT_EQ(verdict.kind, VerdictKind::kRejected);
  EXPECT_THAT(verdict.sentences, Contains("held-out segments fit worse"));
}

TEST(Verdict, OfTheFactorysSaysThatNothingWasEstimated) {
  EXPECT_EQ(Judge(AVersion(1, 1), AVersion(1, 1)).kind, VerdictKind::kFactory);
}

}  // namespace
}  // namespace selfcal::client
