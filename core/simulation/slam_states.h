// Simulates keyframe states as a SLAM system would estimate them: near the
// truth, with errors that drift, and with biases that absorb the errors of its
// calibration.
#pragma once

#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// `truth` are the true states, in order of time, within the samples of `imu`.
std::vector<KeyframeState> SlamStates(const std::vector<KeyframeState>& truth,
                                      const ImuReadings& imu,
                                      const ImuCalibration& imu_true,
                                      const ImuCalibration& imu_slam,
                                      const SimulationOptions& options);

}  // namespace selfcal
