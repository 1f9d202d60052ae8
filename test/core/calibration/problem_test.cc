#include "core/calibration/problem.h"

#include <gtest/gtest.h>

#include "core/factor/inertial.h"
#include "core/simulation/simulate.h"
#include "test/core/calibration/hand_made_segments.h"

namespace selfcal {
namespace {

CalibrationProblem Flatten(const std::vector<MotionSegment>& segments) {
  const std::vector<const MotionSegment*> sorted = SortByKey(segments);
  return FlattenSegments(
      HandheldRig("r"), sorted, PartitionSegments(sorted, 15));
}

// Two joined segments, one after a gap in a partition of its own, and one of
// another session. 5 ids are seen by the first three.
std::vector<MotionSegment> FourSegments() {
  return {HandMadeSegment("a", 0, 0, 0.4, IdRange(0, 20)),
          HandMadeSegment("a", 1, 0.4, 0.8, IdRange(15, 30)),
          HandMadeSegment("a", 7, 5.0, 5.4, IdRange(15, 20)),
          HandMadeSegment("b", 0, 0, 0.4, IdRange(0, 3))};
}

TEST(Problem, GaugeIsHeldByTheFirstKeyframeOfEachPartition) {
  const std::vector<MotionSegment> segments = FourSegments();
  const CalibrationProblem problem = Flatten(segments);
  EXPECT_EQ(problem.keyframes.size(), 16u);
  EXPECT_EQ(problem.gauge_keyframes, (std::vector<int>{0, 8, 12}));
  EXPECT_EQ(problem.chain_starts, (std::vector<int>{0, 8, 12}));
}

// Every keyframe sees all landmarks, from positions that are `step_m` apart.
MotionSegment Passing(MotionSegment segment, double step_m) {
  const std::vector<Observation> first = segment.observations;
  for (int k = 0; k < static_cast<int>(segment.keyframes.size()); ++k) {
    segment.keyframes[k].p_GI.x() = k * step_m;
    for (Observation seen : first) {
      seen.keyframe = k;
      if (k > 0) segment.observations.push_back(seen);
    }
  }
  return segment;
}

// Two of one session with 20 landmarks in common.
std::vector<MotionSegment> TwoSegments(double step_m) {
  return {Passing(HandMadeSegment("a", 0, 0, 0.4, IdRange(0, 20)), step_m),
          Passing(HandMadeSegment("a", 7, 5.0, 5.4, IdRange(0, 20)), step_m)};
}

TEST(Problem, MergedPartitionsHaveOneGaugeButTwoChains) {
  const std::vector<MotionSegment> segments = TwoSegments(0.1);
  const CalibrationProblem problem = Flatten(segments);
  EXPECT_EQ(problem.gauge_keyframes, (std::vector<int>{0}));
  EXPECT_EQ(problem.chain_starts, (std::vector<int>{0, 4}));
  EXPECT_EQ(problem.tracks.size(), 20u);
}

// None of their common landmarks survives screening.
TEST(Problem, WithoutParallaxCommonLandmarksConnectNothing) {
  const std::vector<MotionSegment> segments = TwoSegments(1e-4);
  const CalibrationProblem problem = Flatten(segments);
  EXPECT_EQ(problem.gauge_keyframes, (std::vector<int>{0, 4}));
  EXPECT_EQ(problem.tracks.size(), 40u);
}

TEST(Problem, ALandmarkIsOneTrackWithinAPartitionAndSplitBetweenThem) {
  const std::vector<MotionSegment> segments = FourSegments();
  const CalibrationProblem problem = Flatten(segments);
  // 30 in the joined segments, 5 of them again in the third, 3 in "b".
  ASSERT_EQ(problem.tracks.size(), 38u);
  int seen_by_both = 0;
  for (int t = 0; t < 30; ++t) {
    seen_by_both += problem.tracks[t].observations.size() == 2 ? 1 : 0;
  }
  EXPECT_EQ(seen_by_both, 5);
  for (int t = 30; t < 35; ++t) {
    EXPECT_EQ(problem.tracks[t].id, static_cast<std::uint64_t>(t - 15));
    ASSERT_EQ(problem.tracks[t].observations.size(), 1u);
    EXPECT_EQ(problem.tracks[t].observations[0].keyframe, 8);
  }
}

TEST(Problem, EveryPairOfNeighboursIsLinkedBySamplesThatCoverIt) {
  const std::vector<MotionSegment> segments = FourSegments();
  const CalibrationProblem problem = Flatten(segments);
  EXPECT_EQ(problem.inertial_links.size(), 4u * 3u + 1u);
  bool joint = false;
  for (const InertialLink& link : problem.inertial_links) {
    EXPECT_EQ(link.after, link.before + 1);
    joint |= link.before == 3;
    ASSERT_FALSE(link.samples.empty());
    EXPECT_LE(link.samples.front().t_ns, problem.keyframes[link.before].t_ns);
    EXPECT_GE(link.samples.back().t_ns, problem.keyframes[link.after].t_ns);
  }
  EXPECT_TRUE(joint);
}

TEST(Problem, BiasesWalkOverAGapOfOneSessionOnly) {
  const std::vector<MotionSegment> segments = FourSegments();
  const CalibrationProblem problem = Flatten(segments);
  ASSERT_EQ(problem.bias_links.size(), 1u);
  EXPECT_EQ(problem.bias_links[0].before, 7);
  EXPECT_EQ(problem.bias_links[0].after, 8);
  EXPECT_TRUE(problem.bias_links[0].sigmas.isApprox(
      BiasWalkSigmas(HandheldRig("r").imu_noise, 5.0 - 0.7)));
}

}  // namespace
}  // namespace selfcal
