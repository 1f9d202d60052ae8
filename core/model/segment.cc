#include "core/model/segment.h"

#include <algorithm>
#include <cmath>

#include "core/model/calibration.h"
#include "core/model/so3.h"

namespace selfcal {

KeyframeState BoxPlus(const KeyframeState& state,
                      const Eigen::Ref<const Eigen::VectorXd>& delta) {
  KeyframeState moved = state;
  moved.q_GI =
      (state.q_GI * Exp(delta.segment<3>(kStateRotation))).normalized();
  moved.p_GI += delta.segment<3>(kStatePosition);
  moved.v_GI += delta.segment<3>(kStateVelocity);
  moved.b_a += delta.segment<3>(kStateAccelBias);
  moved.b_g += delta.segment<3>(kStateGyroBias);
  if (delta.size() == kStateTangentSize) return moved;
  moved.v_GJ += delta.segment<3>(kStateTangentSize);
  moved.b_a1 += delta.segment<3>(kStateTangentSize + 3);
  moved.b_g1 += delta.segment<3>(kStateTangentSize + 6);
  return moved;
}

double SessionTime(const MotionSegment& segment, const KeyframeState& x) {
  if (!segment.session_start_ns) return 0;
  return 1e-9 * static_cast<double>(x.t_ns - *segment.session_start_ns);
}

namespace {

// Samples from the last at or before a time, `before_s` before the first
// keyframe.
std::span<const ImuSample> FromFirstKeyframe(const MotionSegment& segment,
                                             const std::vector<ImuSample>& imu,
                                             double before_s = 0) {
  if (segment.keyframes.empty()) return imu;
  const std::int64_t from_ns =
      segment.keyframes.front().t_ns - std::llround(1e9 * before_s);
  const auto later = [](std::int64_t t_ns, const ImuSample& sample) {
    return t_ns < sample.t_ns;
  };
  auto first = std::upper_bound(imu.begin(), imu.end(), from_ns, later);
  if (first != imu.begin()) --first;
  return {first, imu.end()};
}

}  // namespace

std::span<const ImuSample> SamplesFromFirstKeyframe(
    const MotionSegment& segment) {
  return FromFirstKeyframe(segment, segment.imu);
}

std::span<const ImuSample> SecondSamplesFromFirstKeyframe(
    const MotionSegment& segment) {
  return FromFirstKeyframe(segment, segment.imu1, kMaxSecondOffset_s);
}

namespace {

// The samples `imu` from the first keyframe on, up to the last one.
std::span<const ImuSample> ToLastKeyframe(const MotionSegment& segment,
                                          std::span<const ImuSample> imu) {
  if (segment.keyframes.empty()) return imu;
  const auto earlier = [](const ImuSample& sample, std::int64_t t_ns) {
    return sample.t_ns < t_ns;
  };
  auto end = std::lower_bound(
      imu.begin(), imu.end(), segment.keyframes.back().t_ns, earlier);
  if (end != imu.end()) ++end;
  return {imu.begin(), end};
}

}  // namespace

std::span<const ImuSample> SamplesBetweenKeyframes(
    const MotionSegment& segment) {
  return ToLastKeyframe(segment, SamplesFromFirstKeyframe(segment));
}

std::span<const ImuSample> SecondSamplesBetweenKeyframes(
    const MotionSegment& segment) {
  return ToLastKeyframe(segment, FromFirstKeyframe(segment, segment.imu1));
}

}  // namespace selfcal
