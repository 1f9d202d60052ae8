// Devices whose noise is not what the rig states, or not white, or whose
// landmarks are not what they should be.
#include <fmt/format.h>

#include "test/evaluation/noise_cases.h"
#include "test/evaluation/slam_estimator.h"
#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

// The rig states the truth times `factor` for these kinds of noise.
TrustDevice WrongNoise(std::uint64_t seed,
                       const std::vector<NoiseKind>& kinds,
                       double factor) {
  TrustDevice device = MakeTrustDevice(seed);
  device.rig = Believe(device.sensors, {"", kinds, factor});
  AddSession(MakeHandheld(kTrustSession_s, 1, seed),
             "handheld",
             TrustOptions(seed),
             &device);
  return device;
}

TrustDevice WrongImuNoise(std::uint64_t seed, double factor) {
  return WrongNoise(seed,
                    {NoiseKind::kGyro,
                     NoiseKind::kAccel,
                     NoiseKind::kGyroBiasWalk,
                     NoiseKind::kAccelBiasWalk},
                    factor);
}

// Twice as large or half as large.
TrustDevice WrongPixelNoise(std::uint64_t seed) {
  return WrongNoise(seed, {NoiseKind::kPixel}, seed % 2 == 0 ? 2 : 0.5);
}

TrustDevice WithOptions(std::uint64_t seed,
                        void (*change)(SimulationOptions* options)) {
  TrustDevice device = MakeTrustDevice(seed);
  SimulationOptions options = TrustOptions(seed);
  change(&options);
  AddSession(
      MakeHandheld(kTrustSession_s, 1, seed), "handheld", options, &device);
  return device;
}

// Pixels err as those of the tracker do on images, and the rig states 0.8 px.
TrustDevice WithTrackerErrors(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  device.sensors.pixel_sigma_px = kTrackerSigma_px;
  SimulationOptions options = TrustOptions(seed);
  UseTrackerErrors(&options);
  AddSession(
      MakeHandheld(kTrustSession_s, 1, seed), "handheld", options, &device);
  return device;
}

// The SLAM system's states are fitted to the data with its own calibration.
TrustDevice WithEstimatedStates(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(MakeHandheld(kTrustSession_s, 1, seed),
             "handheld",
             TrustOptions(seed),
             &device,
             [rig = device.rig](const Calibration& theta_slam,
                                SimulatedSession* session) {
               session->segments =
                   EstimateStates(rig, theta_slam, session->segments);
             });
  return device;
}

}  // namespace

std::vector<TrustKind> NoiseKinds() {
  std::vector<TrustKind> kinds;
  std::uint64_t first_seed = 30'000;
  for (const int factor : {3, 10}) {
    for (const bool small : {true, false}) {
      kinds.push_back(
          {fmt::format("imu_noise_{}x_{}", factor, small ? "small" : "large"),
           fmt::format("IMU noise stated {} times too {}",
                       factor,
                       small ? "small" : "large"),
           first_seed,
           10,
           factor == 3 && small ? 1 : 0,
           [=](std::uint64_t seed) {
             return WrongImuNoise(seed, small ? 1.0 / factor : factor);
           }});
      first_seed += 1'000;
    }
  }
  kinds.push_back({"pixel_noise_wrong",
                   "pixel noise stated half or twice as large",
                   34'000,
                   10,
                   0,
                   WrongPixelNoise});
  kinds.push_back({"track_correlation",
                   "pixel errors that drift along a track",
                   35'000,
                   10,
                   0,
                   [](std::uint64_t seed) {
                     return WithOptions(seed, [](SimulationOptions* options) {
                       options->pixel_correlation = 0.8;
                     });
                   }});
  kinds.push_back({"tracker_errors",
                   "pixel errors as those of the tracker on images",
                   48'000,
                   10,
                   0,
                   WithTrackerErrors});
  kinds.push_back({"reused_map",
                   "half of the new tracks are of landmarks seen before",
                   36'000,
                   10,
                   0,
                   [](std::uint64_t seed) {
                     return WithOptions(seed, [](SimulationOptions* options) {
                       options->revisit_fraction = 0.5;
                     });
                   }});
  kinds.push_back({"moving_points",
                   "one landmark in ten moves at 0.3 m/s",
                   37'000,
                   10,
                   0,
                   [](std::uint64_t seed) {
                     return WithOptions(seed, [](SimulationOptions* options) {
                       options->moving_fraction = 0.1;
                     });
                   }});
  kinds.push_back({"blur",
                   "exposures of 10 ms: fast images are found less exactly",
                   38'000,
                   10,
                   0,
                   [](std::uint64_t seed) {
                     return WithOptions(seed, [](SimulationOptions* options) {
                       options->exposure_s = 0.01;
                     });
                   }});
  kinds.push_back({"estimated_states",
                   "states fitted to the data with the wrong calibration",
                   39'000,
                   10,
                   0,
                   WithEstimatedStates});
  return kinds;
}

}  // namespace selfcal
