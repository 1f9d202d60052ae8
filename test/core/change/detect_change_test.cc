#include "core/change/detect_change.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

using ::testing::ElementsAre;

class DetectChangeTest : public ::testing::Test {
 protected:
  // Appends the next segment of a device with the given offset.
  void Next(const Eigen::VectorXd& offset, double strength = 1) {
    newest_.push_back(
        tester_.Offset(random_.Segment(rig_, rig_.factory, offset, strength)));
    if (newest_.size() > 64) newest_.erase(newest_.begin());
  }
  void Many(int count, const Eigen::VectorXd& offset) {
    for (int i = 0; i < count; ++i) Next(offset);
  }
  std::optional<Change> Detect() const {
    return DetectChange(tester_, newest_, options_);
  }
  // This many reference sigmas of one component.
  Eigen::VectorXd Sigmas(double sigmas, const std::string& name) const {
    const int i =
        MatchComponents(TangentComponents(rig_.factory), {name}).at(0);
    Eigen::VectorXd offset = zero_;
    offset(i) = sigmas * ReferenceSigmas(rig_)(i);
    return offset;
  }

  const Rig rig_ = HandheldRig("a");
  const Eigen::VectorXd zero_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  RandomInformation random_{3};
  const KnownCalibration active_ = FactoryKnownTo(rig_, 0.05);
  const ConsistencyTester tester_{rig_, active_};
  ChangeOptions options_;
  std::vector<OffsetInformation> newest_;
};

TEST_F(DetectChangeTest, AlarmsAtMostAtTheStatedRateWithoutAChange) {
  options_.false_alarm_rate = 0.05;
  int alarms = 0;
  int tests = 0;
  for (int device = 0; device < 200; ++device) {
    const Eigen::VectorXd error = random_.Noise(active_.covariance);
    newest_.clear();
    for (int i = 0; i < 40; ++i) {
      Next(error);
      ++tests;
      if (Detect()) {
        ++alarms;
        newest_.clear();
      }
    }
  }
  EXPECT_LE(alarms, options_.false_alarm_rate * tests);
  EXPECT_GT(alarms, 0);  // the test is sensitive
}

TEST_F(DetectChangeTest, OneInconsistentSegmentIsNoChange) {
  Many(15, zero_);
  Next(Sigmas(300, "cam0.focal.x"));
  EXPECT_LT(tester_.Test(newest_.back()).probability, 1e-100);
  EXPECT_FALSE(Detect());
  for (int i = 0; i < 16; ++i) {
    Next(zero_);
    EXPECT_FALSE(Detect()) << i << " segments after it";
  }
}

TEST_F(DetectChangeTest, TwoSegmentsAfterAShockAreOne) {
  Many(14, zero_);
  Next(Sigmas(20, "cam0.q_CI.x"));
  EXPECT_FALSE(Detect());
  Next(Sigmas(20, "cam0.q_CI.x"));
  const auto change = Detect();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->kind, ChangeKind::kSudden);
  EXPECT_EQ(change->window, 2);
  // The older of the two may be the one in which it happened.
  EXPECT_EQ(change->segments_since, 1);
  EXPECT_THAT(change->concerned, ElementsAre("extrinsics"));
  ASSERT_EQ(change->groups.size(), rig_.groups.size());
}

TEST_F(DetectChangeTest, ReportsTheSegmentsAfterIt) {
  for (int trial = 0; trial < 20; ++trial) {
    newest_.clear();
    Many(10, zero_);
    Many(6, Sigmas(8, "cam0.focal.x"));
    const auto change = Detect();
    ASSERT_TRUE(change);
    EXPECT_LE(change->segments_since, 5);
    EXPECT_GE(change->segments_since, 3);
    EXPECT_THAT(change->concerned, ElementsAre("camera"));
  }
}

TEST_F(DetectChangeTest, FindsADriftThatNoSingleSegmentReveals) {
  int found = 0;
  int drifts = 0;
  for (int trial = 0; trial < 10; ++trial) {
    newest_.clear();
    Many(10, zero_);
    for (int i = 1; i <= 40; ++i) {
      Next(Sigmas(0.15 * i, "cam0.focal.y"));
      if (const auto change = Detect()) {
        ++found;
        drifts += change->kind == ChangeKind::kDrift;
        EXPECT_GT(tester_.Test(newest_.back()).probability, 1e-6);
        EXPECT_GT(change->window, 2);
        EXPECT_THAT(change->concerned, ElementsAre("camera"));
        break;
      }
    }
  }
  EXPECT_EQ(found, 10);
  EXPECT_GE(drifts, 6);
}

TEST_F(DetectChangeTest, FindsASmallChangeOfFewParameters) {
  int found = 0;
  for (int trial = 0; trial < 10; ++trial) {
    newest_.clear();
    Many(12, zero_);
    std::optional<Change> change;
    for (int i = 0; i < 10 && !change; ++i) {
      Next(Sigmas(3, "cam0.q_CI.y"));
      change = Detect();
    }
    if (!change) continue;
    ++found;
    EXPECT_EQ(change->block, "cam0.q_CI");
    EXPECT_THAT(change->concerned, ElementsAre("extrinsics"));
  }
  EXPECT_GE(found, 8);
}

TEST_F(DetectChangeTest, TrustsSegmentsAsFarAsTheyAgree) {
  // Each has its own error, ten times what it claims.
  for (int i = 0; i < 40; ++i) {
    Next(10 * random_.Direction(rig_));
    EXPECT_FALSE(Detect()) << i;
  }
}

// Segments of an earlier version whose information is noise that looks like
// motion: they claim that theta is that of the version.
TEST_F(DetectChangeTest, SegmentsLinearisedElsewhereAreNoChange) {
  Many(8, zero_);
  const Calibration elsewhere =
      BoxPlus(rig_.factory, 0.9 * random_.Direction(rig_));
  for (int i = 0; i < 40; ++i) {
    newest_.push_back(
        tester_.Offset(random_.Segment(rig_, elsewhere, zero_, 4)));
    EXPECT_FALSE(Detect()) << i;
  }
  for (int i = 0; i < 16; ++i) {
    Next(zero_);
    EXPECT_FALSE(Detect()) << i << " segments after them";
  }
}

// As above, but with another motion before: the spurious information differs
// from motion to motion.
TEST_F(DetectChangeTest,
       SegmentsOfAnotherMotionLinearisedElsewhereAreNoChange) {
  const Eigen::VectorXd off = 0.9 * random_.Direction(rig_);
  const Calibration elsewhere = BoxPlus(rig_.factory, off);
  for (int i = 0; i < 40; ++i) {
    // The first observe theta, the others claim that it is there.
    newest_.push_back(tester_.Offset(random_.Segment(
        rig_, elsewhere, i < 15 ? Eigen::VectorXd(-off) : zero_, 100)));
    EXPECT_FALSE(Detect()) << i;
  }
}

TEST_F(DetectChangeTest, ACarefulFactorNeedsMoreEvidence) {
  Many(14, zero_);
  Many(2, Sigmas(12, "cam0.principal.x"));
  ASSERT_TRUE(Detect());
  const ConsistencyTester careful(rig_, active_, 25);
  newest_.clear();
  for (int i = 0; i < 16; ++i) {
    newest_.push_back(careful.Offset(random_.Segment(
        rig_, rig_.factory, i < 14 ? zero_ : Sigmas(12, "cam0.principal.x"))));
  }
  EXPECT_FALSE(DetectChange(careful, newest_, options_));
}

TEST_F(DetectChangeTest, ARateOfZeroTurnsItOff) {
  Many(16, Sigmas(300, "cam0.focal.x"));
  ASSERT_TRUE(Detect());
  options_.false_alarm_rate = 0;
  EXPECT_FALSE(Detect());
}

TEST_F(DetectChangeTest, NoSegmentsNoChange) {
  EXPECT_FALSE(Detect());
  Next(Sigmas(300, "cam0.focal.x"));
  EXPECT_FALSE(Detect());
}

}  // namespace
}  // namespace selfcal
