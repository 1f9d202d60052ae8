// Devices with a time offset that neither their factory nor their SLAM system
// knows.
#pragma once

#include <cstdint>

#include "core/simulation/simulate.h"

namespace selfcal {

struct DeviceOfUnknownOffset {
  Rig rig;
  Calibration truth;
  SimulatedSession session;
};

// The SLAM system knows all but the offset; the rig estimates it.
inline DeviceOfUnknownOffset WithOffset(double offset_s, std::uint64_t seed) {
  DeviceOfUnknownOffset device{HandheldRig("a"), {}, {}};
  Rig& rig = device.rig;
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks);
  rig.prior_sigmas = {{"cam0.time_offset", 0.1}};
  device.truth = rig.factory;
  device.truth.cameras[0].time_offset_s = offset_s;
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  device.session = Simulate(rig,
                            device.truth,
                            rig.factory,
                            *MakeHandheld(12.8, 1, seed),
                            "s",
                            options);
  return device;
}

}  // namespace selfcal
