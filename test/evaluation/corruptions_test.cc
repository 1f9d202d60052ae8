#include "test/evaluation/corruptions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/information/segment_information.h"
#include "core/model/so3.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

struct RigExample {
  Rig rig;
  SimulatedSession session;
};

RigExample MakeRigExample(const Rig& rig) {
  SimulationOptions options;
  options.seed = 3;
  options.landmarks_in_view = 40;
  return {rig,
          Simulate(rig,
                   rig.factory,
                   PerturbCalibration(rig.factory, {}, 3),
                   *MakeHandheld(12.5, 1, 3),
                   "session",
                   options)};
}

void ExpectValid(const RigExample& example, const MotionSegment& segment) {
  for (const Violation& violation : Validate(segment, example.rig.factory)) {
    ADD_FAILURE() << violation.field << ": " << violation.message;
  }
}

double Median(std::vector<double> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

TEST(CorruptionsTest, ShiftedStampsMoveKeyframesAgainstTheImu) {
  const RigExample example = MakeRigExample(HandheldRig("a"));
  for (const double late_s : {0.01, -0.01}) {
    for (const MotionSegment& segment : example.session.segments) {
      const MotionSegment shifted = ShiftStamps(segment, late_s);
      ExpectValid(example, shifted);
      ASSERT_GE(shifted.keyframes.size() + 1, segment.keyframes.size());
      ASSERT_EQ(shifted.imu.size(), segment.imu.size());
      EXPECT_EQ(shifted.imu.front().t_ns, segment.imu.front().t_ns);
      // A keyframe may be missing at either end.
      const std::size_t lost =
          segment.keyframes.size() - shifted.keyframes.size();
      const std::size_t first = late_s < 0 ? lost : 0;
      for (std::size_t k = 0; k < shifted.keyframes.size(); ++k) {
        EXPECT_EQ(shifted.keyframes[k].t_ns - segment.keyframes[first + k].t_ns,
                  std::llround(late_s * 1e9));
        EXPECT_EQ(shifted.keyframes[k].p_GI, segment.keyframes[first + k].p_GI);
      }
    }
  }
}

TEST(CorruptionsTest, SwappedCamerasExchangeWhatTheySee) {
  const RigExample example = MakeRigExample(StereoRig());
  const MotionSegment& segment = example.session.segments[0];
  const MotionSegment swapped = SwapCameras(segment, example.rig.factory);
  ExpectValid(example, swapped);
  const auto of_camera = [](const MotionSegment& s, int camera) {
    return std::count_if(
        s.observations.begin(),
        s.observations.end(),
        [=](const Observation& o) { return o.camera == camera; });
  };
  // The second image is higher but narrower: few pixels are beyond it.
  EXPECT_GT(of_camera(swapped, 1), 0.9 * of_camera(segment, 0));
  EXPECT_GT(of_camera(swapped, 0), 0.8 * of_camera(segment, 1));
  const MotionSegment again = SwapCameras(swapped, example.rig.factory);
  ASSERT_EQ(again.observations.size(), swapped.observations.size());
  EXPECT_EQ(again.observations[0].camera, 1 - swapped.observations[0].camera);
}

// By the pixels at which the moved points would be seen.
TEST(CorruptionsTest, PartOfTheSceneMovesWithOneVelocity) {
  const RigExample example = MakeRigExample(HandheldRig("a"));
  const MotionSegment& segment = example.session.segments[1];
  const MotionSegment& truth = example.session.truth[1];
  const SceneMotion motion{0.5, 0.5};
  const MotionSegment moved =
      MoveScene(segment, truth, example.rig.factory, motion, 7);
  ExpectValid(example, moved);
  EXPECT_EQ(moved.landmarks.size(), segment.landmarks.size());
  std::vector<double> shift_px(segment.landmarks.size());
  for (const Observation& o : moved.observations) {
    const auto before = std::find_if(segment.observations.begin(),
                                     segment.observations.end(),
                                     [&](const Observation& z) {
                                       return z.keyframe == o.keyframe &&
                                              z.landmark == o.landmark;
                                     });
    ASSERT_NE(before, segment.observations.end());
    double& largest = shift_px[o.landmark];
    largest = std::max(largest, (o.z_px - before->z_px).norm());
  }
  const auto count = static_cast<double>(shift_px.size());
  const auto moving = static_cast<double>(std::count_if(
      shift_px.begin(), shift_px.end(), [](double px) { return px > 0; }));
  EXPECT_NEAR(moving / count, 0.5, 2.5 / std::sqrt(count));
  // 0.5 m/s over half a second at 2 m and 255 px.
  EXPECT_GT(*std::max_element(shift_px.begin(), shift_px.end()), 30);
}

TEST(CorruptionsTest, LostScaleScalesTheWorldButNotTheSensors) {
  const RigExample example = MakeRigExample(HandheldRig("a"));
  const MotionSegment& segment = example.session.segments[1];
  const MotionSegment scaled = LoseScale(segment, 0.7);
  ExpectValid(example, scaled);
  EXPECT_EQ(scaled.imu[5].accel, segment.imu[5].accel);
  for (std::size_t k = 0; k < segment.keyframes.size(); ++k) {
    EXPECT_EQ(scaled.keyframes[k].p_GI, 0.7 * segment.keyframes[k].p_GI);
    EXPECT_EQ(scaled.keyframes[k].v_GI, 0.7 * segment.keyframes[k].v_GI);
  }
  EXPECT_EQ(scaled.landmarks[0].p_G, 0.7 * segment.landmarks[0].p_G);
}

TEST(CorruptionsTest, OneReadingOfTheGyroscopeIsCorrupt) {
  const RigExample example = MakeRigExample(HandheldRig("a"));
  const MotionSegment& segment = example.session.segments[1];
  const MotionSegment corrupt = CorruptGyroSample(segment, 35, 2);
  ExpectValid(example, corrupt);
  int different = 0;
  for (std::size_t i = 0; i < segment.imu.size(); ++i) {
    EXPECT_EQ(corrupt.imu[i].accel, segment.imu[i].accel);
    for (int axis = 0; axis < 3; ++axis) {
      if (corrupt.imu[i].gyro[axis] == segment.imu[i].gyro[axis]) continue;
      ++different;
      EXPECT_EQ(corrupt.imu[i].gyro[axis], 35);
      EXPECT_GT(corrupt.imu[i].t_ns, segment.keyframes.front().t_ns);
      EXPECT_LT(corrupt.imu[i].t_ns, segment.keyframes.back().t_ns);
    }
  }
  EXPECT_EQ(different, 1);
}

// As from the real filter that diverged: valid segments, with a median residual
// of tens of pixels at its own states.
TEST(CorruptionsTest, ADivergedSessionIsValidAndTensOfPixelsOff) {
  const RigExample example = MakeRigExample(HandheldRig("a"));
  const auto diverged = Diverge(example.session.segments, {}, 11);
  ASSERT_EQ(diverged.size(), example.session.segments.size());
  for (const MotionSegment& segment : diverged) {
    ExpectValid(example, segment);
    std::vector<double> residuals_px;
    const CameraCalibration& camera = example.rig.factory.cameras[0];
    for (const Observation& o : segment.observations) {
      const KeyframeState& x = segment.keyframes[o.keyframe];
      const Eigen::Vector3d p_I =
          x.q_GI.conjugate() * (segment.landmarks[o.landmark].p_G - x.p_GI);
      Eigen::Vector2d z_px;
      if (Project(camera, camera.q_CI * p_I + camera.p_CI, &z_px, nullptr)) {
        residuals_px.push_back((z_px - o.z_px).norm());
      }
    }
    ASSERT_GT(residuals_px.size(), segment.observations.size() / 2);
    EXPECT_GT(Median(residuals_px), 10);
    EXPECT_LT(Median(residuals_px), 100);
  }
  const KeyframeState& last = diverged.back().keyframes.back();
  const KeyframeState& meant = example.session.truth.back().keyframes.back();
  EXPECT_GT((last.p_GI - meant.p_GI).norm(), 0.5);
}

}  // namespace
}  // namespace selfcal
