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

LoopedSession::Step LoopedSession::Next(int k) {
  const int loop = k / kLoopKeyframes;
  const int at = k % kLoopKeyframes;
  if (at == 0) next_sample_ = 0;
  const std::int64_t shift_ns = loop * kLoop_ns;
  const auto take_until = [&](std::int64_t t_ns) {
    std::vector<ImuSample> taken;
    while (next_sample_ < imu_.size() && imu_[next_sample_].t_ns <= t_ns) {
      taken.push_back(imu_[next_sample_++]);
      taken.back().t_ns += shift_ns;
    }
    return taken;
  };
  Step step;
  step.state = keyframes_[at];
  step.before = take_until(step.state.t_ns);
  step.state.t_ns += shift_ns;
  step.observations = observations_[at];
  for (KeyframeObservation& o : step.observations) {
    o.landmark_id += loop * landmarks_;
  }
  // What is left of a loop after its last keyframe belongs to it.
  if (at + 1 == kLoopKeyframes) step.after = take_until(kLoop_ns);
  return step;
}

void LoopedSession::Feed(int k, SegmentBuilder* builder) {
  const Step step = Next(k);
  for (const ImuSample& sample : step.before) builder->AddImu(sample);
  builder->AddKeyframe(step.state, step.observations);
  for (const ImuSample& sample : step.after) builder->AddImu(sample);
}

}  // namespace selfcal::client
