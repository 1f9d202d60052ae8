// Segments for the tests of the score: truth or as estimated by a SLAM system,
// and changes of them that must not affect the score.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>

#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// Two cameras side by side with the two other distortion models.
inline Rig TwoCameraRig() {
  Rig rig = HandheldRig("two-cameras");
  CameraCalibration left = rig.factory.cameras[0];
  left.model = DistortionModel::kRadialTangential;
  left.f = {460, 458};
  left.distortion = Eigen::Vector4d(-0.28, 0.07, 2e-4, 2e-5);
  CameraCalibration right = left;
  right.q_CI = Exp({0.01, -0.02, 0.005}) * left.q_CI;
  right.p_CI.x() -= 0.11;
  right.model = DistortionModel::kEquidistant;
  right.f = {275, 276};
  right.distortion = Eigen::Vector4d(0.01, -0.005, 0.002, -0.0004);
  rig.factory.cameras = {left, right};
  return rig;
}

// One segment; of the truth, or of a SLAM system under theta_slam.
struct SegmentPair {
  MotionSegment truth;
  MotionSegment slam;
};

inline SegmentPair OneSegment(const Rig& rig,
                              const Calibration& theta_slam,
                              const Trajectory& trajectory,
                              const SimulationOptions& options) {
  const SimulatedSession session =
      Simulate(rig, rig.factory, theta_slam, trajectory, "session", options);
  return {session.truth.back(), session.segments.back()};
}

inline MotionSegment TrueSegment(const Rig& rig,
                                 const Trajectory& trajectory,
                                 SimulationOptions options = {}) {
  options.noise = false;
  return OneSegment(rig, rig.factory, trajectory, options).truth;
}

inline MotionSegment MovingSegment(const Rig& rig,
                                   std::uint64_t seed,
                                   SimulationOptions options = {}) {
  options.seed = seed;
  return TrueSegment(
      rig,
      *MakeHandheld(
          options.keyframes_per_segment / options.keyframe_rate_hz + 0.1,
          1,
          seed),
      options);
}

inline MotionSegment RestingSegment(const Rig& rig, std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  return TrueSegment(rig, *MakeRest(4.1), options);
}

// The same segment in a world frame that is rotated by yaw and translated.
inline MotionSegment Moved(MotionSegment segment,
                           double yaw_rad,
                           const Eigen::Vector3d& offset_m) {
  const Eigen::Quaterniond q(
      Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
  for (KeyframeState& x : segment.keyframes) {
    x.q_GI = q * x.q_GI;
    x.p_GI = q * x.p_GI + offset_m;
    x.v_GI = q * x.v_GI;
  }
  for (Landmark& landmark : segment.landmarks) {
    landmark.p_G = q * landmark.p_G + offset_m;
  }
  return segment;
}

// Landmarks and observations in a random order.
inline MotionSegment Shuffled(const MotionSegment& segment,
                              std::mt19937* random) {
  MotionSegment result = segment;
  const int size = static_cast<int>(segment.landmarks.size());
  std::vector<int> place(segment.landmarks.size());
  for (int i = 0; i < size; ++i) place[i] = i;
  std::shuffle(place.begin(), place.end(), *random);
  for (int i = 0; i < size; ++i) {
    result.landmarks[place[i]] = segment.landmarks[i];
  }
  for (Observation& o : result.observations) o.landmark = place[o.landmark];
  std::shuffle(result.observations.begin(), result.observations.end(), *random);
  return result;
}

// Without the last keyframe and what it sees.
inline MotionSegment WithoutLastKeyframe(MotionSegment segment) {
  segment.keyframes.pop_back();
  const int size = static_cast<int>(segment.keyframes.size());
  std::erase_if(segment.observations,
                [&](const Observation& o) { return o.keyframe >= size; });
  return segment;
}

}  // namespace selfcal
