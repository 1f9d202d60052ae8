#include "core/calibration/memory_split.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "core/calibration/subspace.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Two sessions of eight segments, linearised at the truth of the first.
class MemorySplitTest : public ::testing::Test {
 protected:
  void AddSession(const std::string& name,
                  const Calibration& truth,
                  std::uint64_t seed) {
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 60;
    options.revisit_fraction = 0;
    const auto session = Simulate(
        rig_, truth, truth, *MakeHandheld(16.5, 1, seed), name, options);
    for (const MotionSegment& segment : session.segments) {
      ends_.push_back(SummariseEnds(rig_, rig_.factory, segment));
    }
  }

  DeviceSplit Find() const { return FindAll().split; }

  SplitFindings FindAll(const RememberedOptions& options = {}) const {
    std::vector<JoinedSegment> joined;
    for (const SegmentEnds& ends : ends_) joined.push_back({.ends = &ends});
    return FindSplit(
        rig_, rig_.factory, WholeSubspace(rig_).estimated, 1, joined, options);
  }

  Rig rig_ = HandheldRig("r");
  std::vector<SegmentEnds> ends_;
};

TEST_F(MemorySplitTest, OneDeviceDoesNotDiffer) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    ends_.clear();
    AddSession("one", rig_.factory, seed);
    AddSession("two", rig_.factory, 100 + seed);
    ASSERT_EQ(ends_.size(), 16u);
    EXPECT_GT(Find().probability, 0.01) << seed;
  }
}

// The camera is rotated by a fifth of a degree.
TEST_F(MemorySplitTest, ARotatedCameraIsDetectedAndNamed) {
  Calibration turned = rig_.factory;
  turned.cameras[0].q_CI = turned.cameras[0].q_CI *
                           Eigen::Quaterniond(Eigen::AngleAxisd(
                               3.5e-3, Eigen::Vector3d(1, 2, 2).normalized()));
  AddSession("one", rig_.factory, 1);
  AddSession("two", turned, 101);
  const DeviceSplit split = Find();
  EXPECT_LT(split.probability, 1e-6);
  EXPECT_EQ(split.kind, ChangeKind::kSudden);
  EXPECT_THAT((std::vector<std::string>{"cam0.q_CI", "extrinsics"}),
              ::testing::Contains(split.block));
  EXPECT_GE(split.newer, 6);
  EXPECT_LE(split.newer, 9);
  EXPECT_EQ(split.first, ends_[16 - split.newer].key);
  EXPECT_THAT(split.concerned, ::testing::Contains("extrinsics"));
  EXPECT_GE(split.without_one, split.probability);
  EXPECT_LT(split.without_one, 1e-4);
}

// A step before one of the four sessions explains it nearly as well.
TEST_F(MemorySplitTest, ADriftIsNotTakenForAStep) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    ends_.clear();
    Calibration zoomed = rig_.factory;
    for (int session = 0; session < 4; ++session) {
      zoomed.cameras[0].f.array() += 0.15;
      AddSession(
          "session-" + std::to_string(session), zoomed, 100 * session + seed);
    }
    const DeviceSplit split = Find();
    EXPECT_LT(split.probability, 1e-4) << seed;
    EXPECT_EQ(split.kind, ChangeKind::kDrift)
        << seed << ": " << split.block << " " << split.newer;
    EXPECT_LE(split.newer, 16) << seed;
  }
}

// Largest component in sigmas of the prior.
double Largest(const Eigen::VectorXd& step, const Rig& rig) {
  return step.cwiseAbs().cwiseQuotient(PriorSigmas(rig)).maxCoeff();
}

TEST_F(MemorySplitTest, WithoutAChangeLittleDoubtRemains) {
  AddSession("one", rig_.factory, 1);
  AddSession("two", rig_.factory, 101);
  const auto doubt = FindAll().doubt;
  ASSERT_TRUE(doubt);
  EXPECT_LT(doubt->probability, 0.5);
  EXPECT_LT(Largest(doubt->step, rig_), 0.01);
}

// The estimate of all segments lies between the two.
TEST_F(MemorySplitTest, TheMeanFollowsARotatedCamera) {
  const int q =
      MatchComponents(TangentComponents(rig_.factory), {"cam0.q_CI.y"}).at(0);
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  turn(q) = 3.5e-3;
  AddSession("one", rig_.factory, 1);
  AddSession("two", BoxPlus(rig_.factory, turn), 101);
  const auto doubt = FindAll().doubt;
  ASSERT_TRUE(doubt);
  EXPECT_GT(doubt->probability, 1 - 1e-6);
  EXPECT_GT(doubt->step(q), 0.25 * turn(q));
  EXPECT_LT(doubt->step(q), 0.75 * turn(q));
}

// A change of a tenth of a pixel in total is not detected by any test.
TEST_F(MemorySplitTest, GroupsThatHaveChangedAreExpectedToContinue) {
  Calibration zoomed = rig_.factory;
  zoomed.cameras[0].f.array() += 0.1;
  AddSession("one", rig_.factory, 3);
  AddSession("two", zoomed, 103);
  EXPECT_GT(Find().probability, 0.05);
  const auto known = FindAll({.changing = {"camera"}}).doubt;
  const auto unknown = FindAll().doubt;
  ASSERT_TRUE(known && unknown);
  EXPECT_GT(known->probability, unknown->probability);
  const auto components = TangentComponents(rig_.factory);
  const int focal = MatchComponents(components, {"cam0.focal.x"}).at(0);
  EXPECT_GT(known->covariance(focal, focal),
            1.5 * unknown->covariance(focal, focal));
  // That of other groups is half as likely.
  const int gyro = MatchComponents(components, {"imu.gyro.scale.x"}).at(0);
  EXPECT_LT(known->covariance(gyro, gyro), unknown->covariance(gyro, gyro));
}

// The split is significant, but not once the segment is excluded.
TEST_F(MemorySplitTest, OneBadSegmentIsNoCertainSplit) {
  AddSession("one", rig_.factory, 1);
  AddSession("two", rig_.factory, 101);
  const int i =
      MatchComponents(TangentComponents(rig_.factory), {"cam0.focal.x"}).at(0);
  SegmentEnds& bad = ends_[14];
  bad.eta += 30 * ReferenceSigmas(rig_)(i) * bad.Lambda.col(i);
  const DeviceSplit split = Find();
  EXPECT_LT(split.probability, 1e-4);
  EXPECT_GT(split.without_one, 1e-3);
}

TEST_F(MemorySplitTest, TooFewSegmentsAreNotTested) {
  AddSession("one", rig_.factory, 1);
  ends_.resize(3);
  EXPECT_EQ(Find().probability, 1);
  EXPECT_EQ(Find().newer, 0);
  EXPECT_FALSE(FindAll().doubt);
}

}  // namespace
}  // namespace selfcal
