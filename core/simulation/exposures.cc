#include "core/simulation/exposures.h"

#include <algorithm>
#include <cmath>

namespace selfcal {

double KeyframeDelay(const Calibration& theta_true,
                     const Calibration& theta_slam) {
  double sum_s = 0;
  for (std::size_t j = 0; j < theta_true.cameras.size(); ++j) {
    sum_s += theta_true.cameras[j].time_offset_s -
             theta_slam.cameras[j].time_offset_s;
  }
  return sum_s / static_cast<double>(theta_true.cameras.size());
}

TimeMargins ExposureMargins(const Calibration& theta_true,
                            const Calibration& theta_slam) {
  const double delay_s = KeyframeDelay(theta_true, theta_slam);
  TimeMargins margins;
  const auto include = [&](double dt_s) {
    margins.before_s = std::max(margins.before_s, -dt_s);
    margins.after_s = std::max(margins.after_s, dt_s);
  };
  include(delay_s);
  for (const CameraCalibration& camera : theta_true.cameras) {
    include(camera.time_offset_s);
  }
  for (const CameraCalibration& camera : theta_slam.cameras) {
    include(delay_s + camera.time_offset_s);
  }
  return margins;
}

std::vector<KeyframeState> StatesLater(
    const std::vector<KeyframeState>& keyframes,
    const Trajectory& trajectory,
    const ImuReadings& imu,
    double dt_s) {
  if (dt_s == 0) return keyframes;
  std::vector<KeyframeState> states;
  for (const KeyframeState& x : keyframes) {
    states.push_back(
        TrueState(trajectory, imu, x.t_ns + std::llround(dt_s * 1e9)));
    states.back().t_ns = x.t_ns;
  }
  return states;
}

Exposures TrueExposures(const Calibration& theta_true,
                        const std::vector<KeyframeState>& keyframes,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  Exposures exposures;
  for (const CameraCalibration& camera : theta_true.cameras) {
    exposures.push_back(
        StatesLater(keyframes, trajectory, imu, camera.time_offset_s));
  }
  return exposures;
}

Exposures SlamExposures(const Calibration& theta_slam,
                        const std::vector<KeyframeState>& slam_states,
                        const std::vector<KeyframeState>& meant,
                        double delay_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  Exposures exposures;
  for (const CameraCalibration& camera : theta_slam.cameras) {
    exposures.push_back(slam_states);
    if (camera.time_offset_s == 0) continue;
    for (std::size_t k = 0; k < meant.size(); ++k) {
      const KeyframeState truth = TrueState(
          trajectory,
          imu,
          meant[k].t_ns + std::llround((delay_s + camera.time_offset_s) * 1e9));
      KeyframeState& x = exposures.back()[k];
      const Eigen::Quaterniond q = x.q_GI * meant[k].q_GI.conjugate();
      x.p_GI += q * (truth.p_GI - meant[k].p_GI);
      x.q_GI = (q * truth.q_GI).normalized();
    }
  }
  return exposures;
}

}  // namespace selfcal
