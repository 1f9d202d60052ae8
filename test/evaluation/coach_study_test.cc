#include "test/evaluation/coach_study.h"

#include <gtest/gtest.h>

#include "core/coach/primitives.h"

namespace selfcal {
namespace {

TEST(CoachStudy, ReadsOffWhenATargetIsReached) {
  CoachRecording recording;
  recording.largest = {10, 2, 0.5, 0.4};
  recording.motions = {"a", "a", "b", "a"};
  EXPECT_EQ(recording.SegmentsTo(20), 1);
  EXPECT_EQ(recording.SegmentsTo(2), 2);
  EXPECT_EQ(recording.SegmentsTo(0.6), 3);
  EXPECT_EQ(recording.SegmentsTo(0.1), 0);
  EXPECT_EQ(recording.Changes(1), 0);
  EXPECT_EQ(recording.Changes(2), 0);
  EXPECT_EQ(recording.Changes(3), 1);
  EXPECT_EQ(recording.Changes(9), 2);
}

TEST(CoachStudy, EveryWayLearnsWithEachSegment) {
  const CoachedDevice device = MakeCoachedDevice(0, 1);
  EXPECT_GT(BoxMinus(device.rig.factory, device.truth).norm(), 0);
  for (const Way way : kWays) {
    const CoachRecording recording = Record(device, way, 3, 1);
    ASSERT_EQ(recording.segments.size(), 3u) << NameOf(way);
    ASSERT_EQ(recording.largest.size(), 3u);
    EXPECT_EQ(recording.segment_s, 4);
    for (int i = 1; i < 3; ++i) {
      EXPECT_LT(recording.largest[i], recording.largest[i - 1]);
      EXPECT_NE(recording.segments[i].key, recording.segments[i - 1].key);
    }
    EXPECT_GT(recording.rms_rate_radps, 0);
    EXPECT_GT(recording.rms_accel_mps2, 0);
    for (const std::string& motion : recording.motions) {
      EXPECT_NE(FindPrimitive(motion), nullptr);
      EXPECT_NE(motion, "hold_still");
    }
  }
}

}  // namespace
}  // namespace selfcal
