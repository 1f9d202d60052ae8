// Tracks and readings of a simulated device, as a recording has them.
#pragma once

#include <vector>

#include "core/initialisation/rotation_start.h"
#include "core/model/rig.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

struct SimulatedTracks {
  std::vector<TrackedImage> images;  // of the first camera
  std::vector<ImuSample> samples;
};

// One segment that fills the trajectory, at 20 images a second, of a device
// with the factory calibration of the rig.
inline SimulationOptions TrackOptions(std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframe_rate_hz = 20;
  options.mean_track_length = 20;
  return options;
}

inline SimulatedTracks SimulateTracksOf(const Rig& rig,
                                        const Trajectory& trajectory,
                                        SimulationOptions options) {
  options.keyframes_per_segment = static_cast<int>(
      (trajectory.duration_s() - 0.5) * options.keyframe_rate_hz);
  const SimulatedSession session =
      Simulate(rig, rig.factory, rig.factory, trajectory, "session", options);
  SimulatedTracks tracks;
  if (session.segments.empty()) return tracks;
  const MotionSegment& segment = session.segments.front();
  tracks.samples = segment.imu;
  for (const KeyframeState& keyframe : segment.keyframes) {
    tracks.images.push_back({keyframe.t_ns, {}});
  }
  for (const Observation& observation : segment.observations) {
    if (observation.camera != 0) continue;
    tracks.images[observation.keyframe].points.push_back(
        {segment.landmarks[observation.landmark].id, observation.z_px});
  }
  return tracks;
}

}  // namespace selfcal
