// Small hand-made segments, for tests that depend on structure only.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// A segment of `keyframes` keyframes, 0.1 s apart from begin_s, with samples
// every 0.02 s up to imu_end_s, in which each of the ids is observed once by
// the first keyframe.
inline MotionSegment HandMadeSegment(const std::string& session,
                                     std::int64_t index,
                                     double begin_s,
                                     double imu_end_s,
                                     const std::vector<std::uint64_t>& ids,
                                     int keyframes = 4) {
  const auto to_ns = [](double t_s) {
    return static_cast<std::int64_t>(std::llround(t_s * 1e9));
  };
  MotionSegment segment;
  segment.key = {session, index};
  for (int k = 0; k < keyframes; ++k) {
    KeyframeState state;
    state.t_ns = to_ns(begin_s + 0.1 * k);
    segment.keyframes.push_back(state);
  }
  for (int i = 0; begin_s + 0.02 * i <= imu_end_s + 1e-9; ++i) {
    ImuSample sample;
    sample.t_ns = to_ns(begin_s + 0.02 * i);
    segment.imu.push_back(sample);
  }
  for (const std::uint64_t id : ids) {
    Observation observation;
    observation.landmark = static_cast<int>(segment.landmarks.size());
    segment.landmarks.push_back({id, {0, 0, 1}});
    segment.observations.push_back(observation);
  }
  return segment;
}

// The ids begin, begin + 1, ..., end - 1.
inline std::vector<std::uint64_t> IdRange(std::uint64_t begin,
                                          std::uint64_t end) {
  std::vector<std::uint64_t> ids;
  for (std::uint64_t id = begin; id < end; ++id) {
    ids.push_back(id);
  }
  return ids;
}

}  // namespace selfcal
