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
#include "core/simulation/simulate.h"

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

// A simulated device in use, for one session.
struct SimulatedUse {
  std::uint64_t seed = 1;  // of the device
  // Sessions of a device differ in their motion and noise, and are named after
  // their number, from 1.
  int session = 1;
  double seconds = 60;
  CameraChange change = {};  // what has become of the device
};

// The device of SimulateDevice under another name, without segments.
Device SimulatedDevice(const std::string& rig, std::uint64_t seed);

// The segments of a session in which the SLAM system runs on `theta_slam`,
// which is `version`. INVALID_ARGUMENT if that is not a calibration of this
// device.
absl::StatusOr<std::vector<MotionSegment>> SimulateUse(
    const Device& device,
    const SimulatedUse& use,
    const Calibration& theta_slam,
    std::int64_t version);

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
