// Exposure times of the images of a simulated rig, and the poses of its body at
// those times: the true ones, and those according to its SLAM system.
#pragma once

#include <functional>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

// States at the exposures of each camera: those of the keyframes themselves for
// a camera without a time offset.
class Exposures {
 public:
  // The state at the exposure of a row of a keyframe's image.
  using OfRow = std::function<KeyframeState(int keyframe, double row_px)>;

  // Adds a camera that exposes all rows at once.
  void AddCamera(std::vector<KeyframeState> states);
  // Adds one with a rolling shutter.
  void AddCamera(OfRow of_row);

  KeyframeState At(int camera, int keyframe, double row_px) const {
    const Camera& c = cameras_[camera];
    return c.of_row ? c.of_row(keyframe, row_px) : c.states[keyframe];
  }
  // Whether the state depends on the row.
  bool IsRolling(int camera) const {
    return static_cast<bool>(cameras_[camera].of_row);
  }

 private:
  struct Camera {
    std::vector<KeyframeState> states;
    OfRow of_row;
  };
  std::vector<Camera> cameras_;
};

// Times [s] of the keyframes since the session began, which was age_s before
// the trajectory.
std::vector<double> SessionTimes(const std::vector<KeyframeState>& keyframes,
                                 double age_s);

// Delay [s] of the instant to which the state of a SLAM system refers, relative
// to its keyframe, session_s after the session began: its poses follow the
// middle of the images, and it assumes other time offsets, drifts and line
// delays. Mean over the cameras.
double KeyframeDelay(const Calibration& theta_true,
                     const Calibration& theta_slam,
                     double session_s);

// The largest time by which any of these, or the begin or end of the readings
// of a second IMU by its clock, is before, or after, its keyframe.
struct TimeMargins {
  double before_s = 0;
  double after_s = 0;
};
// At any time of a trajectory, which begins age_s after the session.
TimeMargins ExposureMargins(const Calibration& theta_true,
                            const Calibration& theta_slam,
                            double age_s,
                            double duration_s);

// The true states dt_s later, each its own, with the times of the keyframes.
std::vector<KeyframeState> StatesLater(
    const std::vector<KeyframeState>& keyframes,
    const Trajectory& trajectory,
    const ImuReadings& imu,
    const std::vector<double>& dt_s);

// All but theta_true must outlive the result.
Exposures TrueExposures(const Calibration& theta_true,
                        const std::vector<KeyframeState>& keyframes,
                        const std::vector<double>& session_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu);

// Exposures computed from the states of the SLAM system, which estimate the
// true states `meant`, `delays_s` after those of the keyframes; between these
// times the body moves as in truth. All but theta_slam must outlive the result.
Exposures SlamExposures(const Calibration& theta_slam,
                        const std::vector<KeyframeState>& slam_states,
                        const std::vector<KeyframeState>& meant,
                        const std::vector<double>& session_s,
                        const std::vector<double>& delays_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu);

}  // namespace selfcal
