#include "core/information/landmark_sketch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "core/information/segment_information.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

// Every landmark is observed as often as its id modulo 7, plus once.
MotionSegment SegmentWith(std::uint64_t first_id, int landmarks) {
  MotionSegment segment;
  for (int m = 0; m < landmarks; ++m) {
    const std::uint64_t id = first_id + m;
    segment.landmarks.push_back({id, Eigen::Vector3d::Zero()});
    for (std::uint64_t i = 0; i <= id % 7; ++i) {
      segment.observations.push_back({0, 0, m, Eigen::Vector2d::Zero()});
    }
  }
  return segment;
}

LandmarkSketch SketchOf(const MotionSegment& segment) {
  std::vector<int> all(segment.observations.size());
  std::iota(all.begin(), all.end(), 0);
  LandmarkSketch sketch;
  SketchLandmarks(segment, all, &sketch);
  return sketch;
}

TEST(LandmarkSketch, HoldsAllOfASmallSegment) {
  for (const int landmarks : {0, 1, 100, kLandmarkSketchSize - 1}) {
    const LandmarkSketch sketch = SketchOf(SegmentWith(50, landmarks));
    ASSERT_EQ(static_cast<int>(sketch.entries.size()), landmarks);
    EXPECT_EQ(KnownUpTo(sketch), std::numeric_limits<std::uint64_t>::max());
    std::set<std::uint64_t> ids;
    std::uint64_t last = 0;
    for (const LandmarkSketch::Entry& entry : sketch.entries) {
      ids.insert(entry.id);
      EXPECT_EQ(entry.observations, static_cast<int>(entry.id % 7) + 1);
      EXPECT_GE(LandmarkHash(entry.id), last);
      last = LandmarkHash(entry.id);
    }
    EXPECT_EQ(static_cast<int>(ids.size()), landmarks);
    if (landmarks > 0) {
      EXPECT_EQ(*ids.begin(), 50u);
      EXPECT_EQ(*ids.rbegin(), 50u + landmarks - 1);
    }
  }
}

TEST(LandmarkSketch, OfALargeSegmentHoldsAllUpToAHash) {
  const MotionSegment segment = SegmentWith(7, 3000);
  const LandmarkSketch sketch = SketchOf(segment);
  ASSERT_EQ(static_cast<int>(sketch.entries.size()), kLandmarkSketchSize);
  std::set<std::uint64_t> held;
  for (const LandmarkSketch::Entry& entry : sketch.entries) {
    held.insert(entry.id);
  }
  for (const Landmark& landmark : segment.landmarks) {
    EXPECT_EQ(held.contains(landmark.id),
              LandmarkHash(landmark.id) <= KnownUpTo(sketch));
  }
}

TEST(LandmarkSketch, OverlapOfTwoIsFoundInTheirCommonRange) {
  const LandmarkSketch a = SketchOf(SegmentWith(0, 5000));
  const LandmarkSketch b = SketchOf(SegmentWith(3000, 5000));
  const std::uint64_t known = std::min(KnownUpTo(a), KnownUpTo(b));
  std::map<std::uint64_t, int> seen;
  int of_a = 0;
  for (const LandmarkSketch* sketch : {&a, &b}) {
    for (const LandmarkSketch::Entry& entry : sketch->entries) {
      if (LandmarkHash(entry.id) > known) continue;
      ++seen[entry.id];
      of_a += sketch == &a ? 1 : 0;
    }
  }
  const auto common = std::count_if(
      seen.begin(), seen.end(), [](const auto& s) { return s.second == 2; });
  // Two of five landmarks are common; three standard errors.
  EXPECT_NEAR(1.0 * common / of_a, 0.4, 0.1);
}

TEST(LandmarkSketch, OfAScoreContainsTheUsedLandmarks) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 3);
  // One landmark whose observations contradict each other.
  const std::uint64_t wrong = segment.landmarks[0].id;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> pixel(20, 460);
  for (Observation& o : segment.observations) {
    if (o.landmark == 0) o.z_px = {pixel(random), pixel(random)};
  }
  const SegmentInformation score = ScoreSegment(rig, rig.factory, segment);
  ASSERT_GT(score.residuals.landmarks_used, kLandmarkSketchSize);
  EXPECT_EQ(static_cast<int>(score.landmarks.entries.size()),
            kLandmarkSketchSize);
  std::map<std::uint64_t, int> tracks;
  for (const Observation& o : segment.observations) {
    ++tracks[segment.landmarks[o.landmark].id];
  }
  for (const LandmarkSketch::Entry& entry : score.landmarks.entries) {
    EXPECT_NE(entry.id, wrong);
    EXPECT_LE(entry.observations, tracks[entry.id]);
    EXPECT_GE(entry.observations, 2);
  }
}

}  // namespace
}  // namespace selfcal
