#include "core/change/group_concern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/change/course.h"
#include "test/core/change/random_information.h"

namespace selfcal {
namespace {

class GroupConcernTest : public ::testing::Test {
 protected:
  int Component(const std::string& name) const {
    return MatchComponents(TangentComponents(rig_.factory), {name}).at(0);
  }
  Eigen::VectorXd Sigmas(double sigmas, const std::string& name) const {
    Eigen::VectorXd offset = zero_;
    offset(Component(name)) = sigmas * ReferenceSigmas(rig_)(Component(name));
    return offset;
  }
  std::vector<SegmentInformation> Segments(int count,
                                           const Eigen::VectorXd& offset) {
    std::vector<SegmentInformation> segments;
    for (int i = 0; i < count; ++i) {
      segments.push_back(random_.Segment(rig_, rig_.factory, offset));
    }
    return segments;
  }
  std::vector<std::string> Concerned(const Eigen::VectorXd& offset) {
    Course course(tester_.root());
    for (const auto& segment : Segments(8, offset)) {
      course.Add(tester_.Offset(segment), 1);
    }
    std::vector<std::string> names;
    for (const auto& group :
         FindConcerned(tester_.groups(), course.Change(), 0.001)) {
      if (group.concerned) names.push_back(group.group);
    }
    return names;
  }

  const Rig rig_ = HandheldRig("a");
  const Eigen::VectorXd zero_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  RandomInformation random_{17};
  const KnownCalibration before_ = FactoryKnownTo(rig_, 0.02);
  const ConsistencyTester tester_{rig_, before_};
};

TEST_F(GroupConcernTest, FindsTheGroupAndBothOfTwo) {
  EXPECT_THAT(Concerned(zero_), ::testing::IsEmpty());
  EXPECT_THAT(Concerned(Sigmas(3, "cam0.q_CI.x")),
              ::testing::ElementsAre("extrinsics"));
  EXPECT_THAT(Concerned(Sigmas(3, "cam0.q_CI.x") + Sigmas(3, "cam0.focal.x")),
              ::testing::ElementsAre("camera", "extrinsics"));
}

// Without information: the expectation of the squares in the header.
TEST_F(GroupConcernTest, WithoutSegmentsDoubtIsThatOfThePrior) {
  const Eigen::MatrixXd doubt =
      DoubtOfUnconcerned(rig_, before_, {}, {"extrinsics"});
  const double mean_square = (1e-4 + 9e-4 + 1e-2 + 9e-2 + 1) / 5;
  const int focal = Component("cam0.focal.x");
  EXPECT_NEAR(std::sqrt(doubt(focal, focal)) / PriorSigmas(rig_)(focal),
              std::sqrt(mean_square / 2),
              1e-9);
  EXPECT_EQ(doubt(Component("cam0.q_CI.x"), Component("cam0.q_CI.x")), 0);
  EXPECT_EQ(doubt(Component("cam0.time_offset"), Component("cam0.time_offset")),
            0);
}

TEST_F(GroupConcernTest, SegmentsThatShowNoChangeLeaveLittleDoubt) {
  const auto segments = Segments(12, Sigmas(5, "cam0.q_CI.x"));
  const Eigen::MatrixXd doubt =
      DoubtOfUnconcerned(rig_, before_, segments, {"extrinsics"});
  for (const char* name : {"cam0.focal.x", "imu.gyro.scale.x"}) {
    const int i = Component(name);
    // Below half of a reference sigma, which a segment resolves; above nothing.
    EXPECT_LT(std::sqrt(doubt(i, i)), 0.5 * ReferenceSigmas(rig_)(i)) << name;
    EXPECT_GT(doubt(i, i), 0) << name;
  }
}

// A missed change: the prior is as wide as the change.
TEST_F(GroupConcernTest, SegmentsThatShowAChangeLeaveItsSize) {
  const auto segments =
      Segments(12, Sigmas(5, "cam0.q_CI.x") + Sigmas(4, "cam0.focal.x"));
  const Eigen::MatrixXd doubt =
      DoubtOfUnconcerned(rig_, before_, segments, {"extrinsics"});
  const int focal = Component("cam0.focal.x");
  EXPECT_NEAR(
      std::sqrt(doubt(focal, focal)) / ReferenceSigmas(rig_)(focal), 4, 1);
  const int scale = Component("imu.gyro.scale.x");
  EXPECT_LT(std::sqrt(doubt(scale, scale)), 0.5 * ReferenceSigmas(rig_)(scale));
}

}  // namespace
}  // namespace selfcal
