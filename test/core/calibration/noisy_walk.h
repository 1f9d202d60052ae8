// A walking device whose noise can be estimated.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// A device whose IMU is so much noisier than that of a phone that a few seconds
// determine its noise.
inline Rig NoisyRig() {
  Rig rig = HandheldRig("r");
  rig.imu_noise.gyro_noise_density = 5e-3;
  rig.imu_noise.accel_noise_density = 5e-2;
  return rig;
}

inline std::vector<MotionSegment> Walk(const Rig& rig,
                                       int segments,
                                       int keyframes,
                                       int landmarks,
                                       std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = keyframes;
  options.landmarks_in_view = landmarks;
  options.revisit_fraction = 0;
  const double seconds = segments * keyframes / 10.0 + 0.5;
  return Simulate(rig,
                  rig.factory,
                  rig.factory,
                  *MakeHandheld(seconds, 1.0, seed),
                  "session",
                  options)
      .segments;
}

}  // namespace selfcal
