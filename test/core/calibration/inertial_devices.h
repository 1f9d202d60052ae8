// Devices for tests of inertial factors: sparse and dense keyframes, lost
// samples. Their biases walk as those of a drone's or a phone's IMU, so that
// the walk between two keyframes matters.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"

namespace selfcal {

struct InertialCase {
  std::string name;
  double keyframe_rate_hz = 10;
  double lost_fraction = 0;
  double gap_s = 0;  // one in each segment
};

inline std::vector<InertialCase> InertialCases() {
  return {{"keyframes_1_hz", 1},
          {"keyframes_2_hz", 2},
          {"keyframes_5_hz", 5},
          {"keyframes_10_hz", 10},
          {"keyframes_20_hz", 20},
          {"lost_samples", 10, 0.05},
          {"gaps", 10, 0, 0.1}};
}

struct InertialOutcome {
  CalibrateStatus status = CalibrateStatus::kFailed;
  std::string message = "";
  Eigen::VectorXd error = {};       // of the free components
  Eigen::MatrixXd covariance = {};  // likewise
  int held = 0;
};

// A calibration of one device, on six segments.
inline InertialOutcome CalibrateInertialDevice(const InertialCase& of,
                                               std::uint64_t seed) {
  Rig rig = HandheldRig("inertial");
  rig.imu_noise = ImuNoise();
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, seed);
  SimulationOptions options;
  options.seed = seed;
  options.keyframe_rate_hz = of.keyframe_rate_hz;
  // A segment lasts two seconds or more, and has 20 keyframes or more.
  options.keyframes_per_segment = of.keyframe_rate_hz < 20 ? 20 : 40;
  // Features are not tracked over seconds of vigorous motion, but found again.
  options.mean_track_length = of.keyframe_rate_hz < 5 ? 4 : 10;
  options.revisit_fraction = of.keyframe_rate_hz < 5 ? 0.4 : 0.1;
  options.imu_lost_fraction = of.lost_fraction;
  options.imu_gap_s = of.gap_s;
  const double duration_s =
      6 * options.keyframes_per_segment / of.keyframe_rate_hz + 1;
  const SimulatedSession session =
      Simulate(rig,
               truth,
               rig.factory,
               *MakeHandheld(duration_s, 0.7, seed),
               "session",
               options);
  const CalibrationResult result =
      Calibrate(rig, rig.factory, session.segments, {.noise_scales = false});
  InertialOutcome outcome = {.status = result.status,
                             .message = result.message};
  if (result.covariance.size() == 0) return outcome;
  const std::vector<int> free = FreeComponents(rig);
  outcome.error = BoxMinus(result.theta, truth)(free);
  outcome.covariance = result.covariance(free, free);
  outcome.held = static_cast<int>(result.held_constant.size());
  return outcome;
}

}  // namespace selfcal
