#include "core/change/split.h"

#include <gtest/gtest.h>

#include <vector>

#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

class SplitTestTest : public ::testing::Test {
 protected:
  // So many reference sigmas of one component.
  Eigen::VectorXd Sigmas(double sigmas, const std::string& name) const {
    Eigen::VectorXd offset = zero_;
    const int i =
        MatchComponents(TangentComponents(rig_.factory), {name}).at(0);
    offset(i) = sigmas * ReferenceSigmas(rig_)(i);
    return offset;
  }
  void Add(int count, const Eigen::VectorXd& offset) {
    for (int i = 0; i < count; ++i) {
      segments_.push_back(random_.Segment(rig_, rig_.factory, offset));
      times_.push_back(static_cast<std::int64_t>(4e9) *
                       static_cast<std::int64_t>(times_.size()));
    }
  }
  SplitTest Test() const {
    return TestSplit(rig_, rig_.factory, segments_, times_);
  }

  const Rig rig_ = HandheldRig("a");
  const Eigen::VectorXd zero_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  RandomInformation random_{13};
  std::vector<SegmentInformation> segments_;
  std::vector<std::int64_t> times_;
};

TEST_F(SplitTestTest, FindsWhereTheDeviceChanged) {
  // The calibration is right for neither: in the middle of both.
  Add(9, Sigmas(-2.5, "cam0.q_CI.y"));
  Add(7, Sigmas(2.5, "cam0.q_CI.y"));
  const SplitTest test = Test();
  EXPECT_EQ(test.segments, 16);
  EXPECT_LT(test.probability, 1e-6);
  EXPECT_EQ(test.first_after, 9);
  EXPECT_EQ(test.kind, ChangeKind::kSudden);
  EXPECT_EQ(test.block, "cam0.q_CI");
}

TEST_F(SplitTestTest, FindsADrift) {
  for (int i = 0; i < 24; ++i) Add(1, Sigmas(0.3 * i - 3.5, "cam0.focal.x"));
  const SplitTest test = Test();
  EXPECT_LT(test.probability, 1e-6);
  EXPECT_EQ(test.kind, ChangeKind::kDrift);
}

TEST_F(SplitTestTest, IsAsRareAsItSaysWithoutAChange) {
  int rare = 0;
  for (int trial = 0; trial < 60; ++trial) {
    segments_.clear();
    times_.clear();
    // What the calibration is off by is no difference between segments.
    Add(12, 0.5 * random_.Direction(rig_));
    rare += Test().probability < 0.02;
  }
  EXPECT_LE(rare, 4);  // 99 % of the binomial distribution
}

TEST_F(SplitTestTest, OneBadSegmentIsNoSplit) {
  for (const int at : {0, 5, 11}) {
    segments_.clear();
    times_.clear();
    Add(at, zero_);
    Add(1, Sigmas(50, "cam0.focal.x"));
    Add(11 - at, zero_);
    EXPECT_GT(Test().probability, 0.01) << at;
  }
}

TEST_F(SplitTestTest, TestsNothingWhereThereIsTooLittle) {
  EXPECT_EQ(Test().segments, 0);
  Add(3, zero_);
  EXPECT_EQ(Test().segments, 0);
  Add(6, zero_);
  for (int i = 3; i < 9; ++i) segments_[i].residuals.many_outliers = true;
  EXPECT_EQ(Test().segments, 0);
  EXPECT_EQ(Test().probability, 1);
}

TEST_F(SplitTestTest, CountsSegmentsThatItLeavesOut) {
  Add(9, Sigmas(-4, "cam0.q_CI.y"));
  Add(7, Sigmas(4, "cam0.q_CI.y"));
  segments_[2].residuals.many_outliers = true;
  EXPECT_EQ(Test().first_after, 9);
  EXPECT_EQ(Test().segments, 15);
}

}  // namespace
}  // namespace selfcal
