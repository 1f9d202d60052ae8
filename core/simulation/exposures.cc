#include "core/simulation/exposures.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace selfcal {
namespace {

// Time from the first row of an image to another.
double RowDelay(const CameraCalibration& camera, double row_px) {
  return camera.line_delay_s.value_or(0) * row_px;
}

KeyframeState StateLater(const KeyframeState& x,
                         const Trajectory& trajectory,
                         const ImuReadings& imu,
                         double dt_s) {
  KeyframeState later =
      TrueState(trajectory, imu, x.t_ns + std::llround(dt_s * 1e9));
  later.t_ns = x.t_ns;
  return later;
}

}  // namespace

void Exposures::AddCamera(std::vector<KeyframeState> states) {
  cameras_.push_back({std::move(states), nullptr});
}

void Exposures::AddCamera(OfRow of_row) {
  cameras_.push_back({{}, std::move(of_row)});
}

double KeyframeDelay(const Calibration& theta_true,
                     const Calibration& theta_slam) {
  double sum_s = 0;
  for (std::size_t j = 0; j < theta_true.cameras.size(); ++j) {
    sum_s += MiddleRowDelay(theta_true.cameras[j]) -
             MiddleRowDelay(theta_slam.cameras[j]);
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
  const auto include_image = [&](double dt_s, const CameraCalibration& camera) {
    include(dt_s + camera.time_offset_s);
    include(dt_s + camera.time_offset_s + RowDelay(camera, camera.height_px));
  };
  include(delay_s);
  for (const CameraCalibration& camera : theta_true.cameras) {
    include_image(0, camera);
  }
  for (const CameraCalibration& camera : theta_slam.cameras) {
    include_image(delay_s, camera);
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
    states.push_back(StateLater(x, trajectory, imu, dt_s));
  }
  return states;
}

Exposures TrueExposures(const Calibration& theta_true,
                        const std::vector<KeyframeState>& keyframes,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  Exposures exposures;
  for (const CameraCalibration& camera : theta_true.cameras) {
    if (!camera.line_delay_s) {
      exposures.AddCamera(
          StatesLater(keyframes, trajectory, imu, camera.time_offset_s));
      continue;
    }
    exposures.AddCamera([&, camera](int k, double row_px) {
      return StateLater(keyframes[k],
                        trajectory,
                        imu,
                        camera.time_offset_s + RowDelay(camera, row_px));
    });
  }
  return exposures;
}

Exposures SlamExposures(const Calibration& theta_slam,
                        const std::vector<KeyframeState>& slam_states,
                        const std::vector<KeyframeState>& meant,
                        double delay_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  // The state of the SLAM system dt_s after that of a keyframe.
  const auto later = [&, delay_s](std::size_t k, double dt_s) {
    const KeyframeState truth = TrueState(
        trajectory, imu, meant[k].t_ns + std::llround((delay_s + dt_s) * 1e9));
    KeyframeState x = slam_states[k];
    const Eigen::Quaterniond q = x.q_GI * meant[k].q_GI.conjugate();
    x.p_GI += q * (truth.p_GI - meant[k].p_GI);
    x.q_GI = (q * truth.q_GI).normalized();
    return x;
  };
  Exposures exposures;
  for (const CameraCalibration& camera : theta_slam.cameras) {
    if (camera.line_delay_s) {
      exposures.AddCamera([later, camera](int k, double row_px) {
        return later(k, camera.time_offset_s + RowDelay(camera, row_px));
      });
      continue;
    }
    std::vector<KeyframeState> states = slam_states;
    if (camera.time_offset_s != 0) {
      for (std::size_t k = 0; k < meant.size(); ++k) {
        states[k] = later(k, camera.time_offset_s);
      }
    }
    exposures.AddCamera(std::move(states));
  }
  return exposures;
}

}  // namespace selfcal
