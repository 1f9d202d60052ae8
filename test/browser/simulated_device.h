// The device of the test of the pages: what it is made of, and what it records.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {

struct SimulatedDevice {
  Rig rig;  // its factory calibration is off
  Calibration truth;
};

inline SimulatedDevice MakeDevice(const std::string& id,
                                  bool has_second_imu = false) {
  SimulatedDevice device{HandheldRig(id), {}};
  if (has_second_imu) AddSecondImu(&device.rig);
  device.rig.table_size = 4;
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(device.truth, {}, 1);
  return device;
}

inline std::vector<MotionSegment> Record(const SimulatedDevice& device,
                                         const Trajectory& trajectory,
                                         const std::string& session) {
  SimulationOptions options;
  options.keyframes_per_segment = 20;
  options.landmarks_in_view = 60;
  return Simulate(device.rig,
                  device.truth,
                  device.rig.factory,
                  trajectory,
                  session,
                  options)
      .segments;
}

}  // namespace selfcal
