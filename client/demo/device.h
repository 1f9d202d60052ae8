// The device of the demo: a simulation with known truth, or a recording.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct Device {
  Rig rig;
  std::vector<MotionSegment> segments;
  std::optional<Calibration> truth;  // known for a simulation only
  std::string description;
};

// A hand-held device whose factory calibration is off by a realistic amount
// (CalibrationError), in calm and excited motion for `seconds`.
Device SimulateDevice(std::uint64_t seed, double seconds);

struct RecordingOptions {
  int keyframes_per_segment = 40;
  // These override the values of the file.
  std::optional<double> gyro_bias_walk;
  std::optional<double> accel_bias_walk;
};

// Several folders are consecutive submaps of one recording.
absl::StatusOr<Device> ReadDevice(const std::vector<std::string>& folders,
                                  const RecordingOptions& options);

}  // namespace selfcal::client
