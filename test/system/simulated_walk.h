// A small simulated device: a minute of vigorous motion in short segments.
#pragma once

#include "client/demo/device.h"
#include "core/simulation/simulate.h"

namespace selfcal::client {

inline Device SimulateWalk(const std::string& rig,
                           int segments,
                           std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 10;
  const double seconds =
      (segments * options.keyframes_per_segment + 1) / options.keyframe_rate_hz;
  Device device;
  device.rig = HandheldRig(rig);
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(*device.truth, {}, seed);
  device.segments = Simulate(device.rig,
                             *device.truth,
                             device.rig.factory,
                             *MakeHandheld(seconds, 1, seed),
                             "walk",
                             options)
                        .segments;
  device.segments.resize(segments);
  return device;
}

}  // namespace selfcal::client
