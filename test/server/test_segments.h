// Small valid rigs and segments for tests of the server: a simulated hand-held
// device with few keyframes and landmarks, scored in milliseconds.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal::server {

inline Rig TestRig(const std::string& id) {
  Rig rig = HandheldRig(id);
  rig.table_size = 2;
  return rig;
}

// `count` segments of one session that follow each other, index 0 first. The
// same arguments give the same segments.
inline std::vector<MotionSegment> TestSegments(const Rig& rig,
                                               int count,
                                               const std::string& session = "s",
                                               std::uint64_t seed = 1) {
  SimulationOptions options;
  options.seed = seed;
  options.imu_rate_hz = 100;
  options.keyframes_per_segment = 8;
  options.landmarks_in_view = 30;
  const double segment_s =
      options.keyframes_per_segment / options.keyframe_rate_hz;
  const auto trajectory = MakeHandheld((count + 1) * segment_s, 1.0, seed);
  auto segments =
      Simulate(rig, rig.factory, rig.factory, *trajectory, session, options)
          .segments;
  segments.resize(count);
  return segments;
}

}  // namespace selfcal::server
