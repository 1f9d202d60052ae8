#include "test/system/looped_session.h"

#include <algorithm>
#include <numbers>

#include "core/simulation/simulate.h"
#include "test/swing_trajectory.h"

namespace selfcal::client {
namespace {

constexpr std::int64_t kLoop_ns = 40'000'000'000;

// Every coordinate swings a whole number of times in a loop.
SwingTrajectory LoopTrajectory(double duration_s) {
  const auto swing = [](double amplitude, int times) {
    const double omega = 2 * std::numbers::pi * times / (1e-9 * kLoop_ns);
    return Swing{.amplitude = amplitude, .omega = omega, .phase = 1.0 * times};
  };
  return {duration_s,
          {swing(0.8, 11), swing(0.6, 17), swing(0.3, 23)},
          {swing(0.3, 31), swing(0.4, 19), swing(0.6, 13)}};
}

}  // namespace

LoopedSession::LoopedSession(const Rig& rig, const Calibration& theta) {
  SimulationOptions options;
  options.keyframes_per_segment = kLoopKeyframes;
  const double duration_s = (kLoopKeyframes + 1) / options.keyframe_rate_hz;
  const MotionSegment loop =
      Simulate(
          rig, theta, rig.factory, LoopTrajectory(duration_s), "loop", options)
          .segments.front();
  for (const ImuSample& sample : loop.imu) {
    if (sample.t_ns < kLoop_ns) imu_.push_back(sample);
  }
  keyframes_ = loop.keyframes;
  observations_.resize(keyframes_.size());
  for (const Observation& o : loop.observations) {
    const Landmark& landmark = loop.landmarks[o.landmark];
    observations_[o.keyframe].push_back(
        {o.camera, landmark.id, o.z_px, landmark.p_G});
    landmarks_ = std::max(landmarks_, landmark.id + 1);
  }
}

void LoopedSession::Feed(int k, SegmentBuilder* builder) {
  const int loop = k / kLoopKeyframes;
  const int at = k % kLoopKeyframes;
  if (at == 0) next_sample_ = 0;
  const std::int64_t shift_ns = loop * kLoop_ns;
  // What is left of a loop after its last keyframe belongs to it.
  const bool last = at + 1 == kLoopKeyframes;
  const auto feed_until = [&](std::int64_t t_ns) {
    while (next_sample_ < imu_.size() && imu_[next_sample_].t_ns <= t_ns) {
      ImuSample sample = imu_[next_sample_++];
      sample.t_ns += shift_ns;
      builder->AddImu(sample);
    }
  };
  KeyframeState state = keyframes_[at];
  feed_until(state.t_ns);
  state.t_ns += shift_ns;
  std::vector<KeyframeObservation> seen = observations_[at];
  for (KeyframeObservation& o : seen) o.landmark_id += loop * landmarks_;
  builder->AddKeyframe(state, seen);
  if (last) feed_until(kLoop_ns);
}

}  // namespace selfcal::client
