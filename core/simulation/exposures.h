// When the images of a simulated rig are exposed, and where its body is then,
// in truth and as its SLAM system believes.
#pragma once

#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

// States at the exposures of each camera, one for each keyframe: those of the
// keyframes themselves for a camera without a time offset.
using Exposures = std::vector<std::vector<KeyframeState>>;

// What a SLAM system takes for the instant of a keyframe is later by this [s]:
// its poses follow the images, and it believes in other time offsets. The mean
// over the cameras.
double KeyframeDelay(const Calibration& theta_true,
                     const Calibration& theta_slam);

// The latest any of these are before, and after, the time of their keyframe.
struct TimeMargins {
  double before_s = 0;
  double after_s = 0;
};
TimeMargins ExposureMargins(const Calibration& theta_true,
                            const Calibration& theta_slam);

// The true states dt_s later, with the times of the keyframes.
std::vector<KeyframeState> StatesLater(
    const std::vector<KeyframeState>& keyframes,
    const Trajectory& trajectory,
    const ImuReadings& imu,
    double dt_s);

Exposures TrueExposures(const Calibration& theta_true,
                        const std::vector<KeyframeState>& keyframes,
                        const Trajectory& trajectory,
                        const ImuReadings& imu);

// From the states of the SLAM system, which stand for the true ones `meant`,
// `delay_s` after those of the keyframes, moved as the body truly moves.
Exposures SlamExposures(const Calibration& theta_slam,
                        const std::vector<KeyframeState>& slam_states,
                        const std::vector<KeyframeState>& meant,
                        double delay_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu);

}  // namespace selfcal
