#include "client/demo/device.h"

#include <fmt/format.h>

#include "client/import/vi_map.h"
#include "core/simulation/simulate.h"

namespace selfcal::client {

Device SimulateDevice(std::uint64_t seed, double seconds) {
  Device device;
  device.rig = HandheldRig("simulated");
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(*device.truth, {}, seed);
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
