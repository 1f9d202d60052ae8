#include "client/demo/device.h"

#include <fmt/format.h>

#include "client/import/vi_map.h"
#include "core/simulation/simulate.h"

namespace selfcal::client {

Device SimulatedDevice(const std::string& rig, std::uint64_t seed) {
  Device device;
  device.rig = HandheldRig(rig);
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(*device.truth, {}, seed);
  return device;
}

Device SimulateDevice(std::uint64_t seed, double seconds) {
  Device device = SimulatedDevice("simulated", seed);
  SimulationOptions options;
  options.seed = seed;
  device.segments = Simulate(device.rig,
                             *device.truth,
                             device.rig.factory,
                             *MakeMixed(seconds, seed),
                             "walk",
                             options)
                        .segments;
  device.description = fmt::format(
      "a simulated hand-held device, {:.0f} s of calm and excited motion, its "
      "factory calibration off by f 2 %, c 5 px, w 1 %, extrinsics 1 deg and "
      "1 cm, scales 1 %, misalignments 0.01, accelerometer 1 deg",
      seconds);
  return device;
}

absl::StatusOr<std::vector<MotionSegment>> SimulateUse(
    const Device& device,
    const SimulatedUse& use,
    const Calibration& theta_slam,
    std::int64_t version) {
  if (!SameShape(theta_slam, *device.truth)) {
    return absl::InvalidArgumentError(
        fmt::format("rigs/{} is not a simulated device: its cameras are others",
                    device.rig.id));
  }
  SimulationOptions options;
  // Not the seeds that neighbouring devices have.
  options.seed = use.seed + (static_cast<std::uint64_t>(use.session - 1) << 32);
  std::vector<MotionSegment> segments =
      Simulate(device.rig,
               ChangeCamera(*device.truth, use.change),
               theta_slam,
               *MakeMixed(use.seconds, options.seed),
               fmt::format("session-{}", use.session),
               options)
          .segments;
  for (MotionSegment& segment : segments) segment.calibration_version = version;
  return segments;
}

absl::StatusOr<Device> ReadDevice(const std::vector<std::string>& folders,
                                  const RecordingOptions& options) {
  absl::StatusOr<ViMapRecording> recording =
      folders.size() == 1 ? ReadViMap(folders[0], {}) : ReadViMaps(folders, {});
  if (!recording.ok()) return recording.status();
  Device device;
  device.rig = recording->rig;
  device.rig.id = "recorded";
  if (options.gyro_bias_walk) {
    device.rig.imu_noise.gyro_bias_random_walk = *options.gyro_bias_walk;
  }
  if (options.accel_bias_walk) {
    device.rig.imu_noise.accel_bias_random_walk = *options.accel_bias_walk;
  }
  device.segments = BuildSegments(*recording,
                                  {.session = recording->session,
                                   .keyframes = options.keyframes_per_segment});
  if (device.segments.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "the recording has {} keyframes, too few for a segment of {}; give "
        "fewer with --keyframes",
        recording->keyframes.size(),
        options.keyframes_per_segment));
  }
  device.description = fmt::format("the recording {}: {} keyframes",
                                   folders[0],
                                   recording->keyframes.size());
  return device;
}

}  // namespace selfcal::client
