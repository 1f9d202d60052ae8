// Scores of rigs whose time offset nobody knows start at what the gyroscope
// shows.
#include "core/information/offset_start.h"

#include <gtest/gtest.h>

#include "core/information/segment_information.h"
#include "test/core/information/unknown_offset.h"

namespace selfcal {
namespace {

TEST(OffsetStart, HasTheStatesOfTheTruth) {
  for (const double offset_s : {-0.1, 0.02, 0.05, 0.1}) {
    const DeviceOfUnknownOffset device = WithOffset(offset_s, 1);
    const auto& segments = device.session.segments;
    for (std::size_t s = 0; s < segments.size(); ++s) {
      const auto start =
          FindOffsetStart(device.rig, device.rig.factory, segments[s]);
      ASSERT_TRUE(start.has_value()) << offset_s;
      EXPECT_NEAR(start->shift_s, offset_s, 2e-3);
      EXPECT_EQ(start->theta.cameras[0].time_offset_s, start->shift_s);
      double before = 0, after = 0;
      for (std::size_t k = 0; k < segments[s].keyframes.size(); ++k) {
        const KeyframeState& truth = device.session.truth[s].keyframes[k];
        const KeyframeState& sent = segments[s].keyframes[k];
        const KeyframeState& moved = start->segment.keyframes[k];
        EXPECT_EQ(moved.t_ns, sent.t_ns);
        before += sent.q_GI.angularDistance(truth.q_GI);
        after += moved.q_GI.angularDistance(truth.q_GI);
      }
      EXPECT_LT(after, 0.5 * before);
    }
  }
}

// A newer calibration has the offset that the SLAM system does not know yet.
TEST(OffsetStart, KeepsAnOffsetThatThetaHasAlready) {
  const DeviceOfUnknownOffset device = WithOffset(0.05, 2);
  for (const MotionSegment& segment : device.session.segments) {
    const auto start = FindOffsetStart(device.rig, device.truth, segment);
    ASSERT_TRUE(start.has_value());
    EXPECT_EQ(start->shift_s, 0);
    EXPECT_EQ(start->theta.cameras[0].time_offset_s, 0.05);
  }
}

TEST(OffsetStart, IsOfNoUseNearTheOffsetOrIfItIsNotEstimated) {
  const DeviceOfUnknownOffset near = WithOffset(0.005, 3);
  for (const MotionSegment& segment : near.session.segments) {
    EXPECT_FALSE(FindOffsetStart(near.rig, near.rig.factory, segment));
  }
  DeviceOfUnknownOffset known = WithOffset(0.05, 3);
  known.rig.blocks = {};
  for (const MotionSegment& segment : known.session.segments) {
    EXPECT_FALSE(FindOffsetStart(known.rig, known.rig.factory, segment));
  }
  // Nor if it is held while its slope with temperature is estimated.
  known.rig.blocks = {{"*.time_offset", false}, {"*.time_offset_slope", true}};
  AddEstimatedBlocks(known.rig.blocks, &known.rig.factory);
  for (MotionSegment segment : known.session.segments) {
    segment.temperature_c = 30;
    EXPECT_FALSE(FindOffsetStart(known.rig, known.rig.factory, segment));
  }
}

// A segment that does not fit where it would be scored is scored at the start.
TEST(OffsetStart, ScoresFitAsTheyDoWithoutAnOffset) {
  const DeviceOfUnknownOffset none = WithOffset(0, 4);
  for (const double offset_s : {0.02, 0.05, 0.1}) {
    const DeviceOfUnknownOffset device = WithOffset(offset_s, 4);
    for (std::size_t s = 0; s < device.session.segments.size(); ++s) {
      const SegmentInformation score = ScoreSegment(
          device.rig, device.rig.factory, device.session.segments[s]);
      if (offset_s < 0.1) {
        EXPECT_LE(score.residuals.fit, kOrdinaryFit);
        continue;
      }
      EXPECT_NEAR(score.theta0.cameras[0].time_offset_s, offset_s, 2e-3);
      const SegmentInformation plain =
          ScoreSegment(none.rig, none.rig.factory, none.session.segments[s]);
      EXPECT_LT(score.residuals.fit, 1.2 * plain.residuals.fit + 0.1);
      EXPECT_LT(score.residuals.outliers,
                plain.residuals.outliers + 0.02 * plain.residuals.observations);
    }
  }
}

}  // namespace
}  // namespace selfcal
