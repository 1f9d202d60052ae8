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

std::vector<double> OffsetsAt(const CameraCalibration& camera,
                              const std::vector<double>& session_s) {
  std::vector<double> offsets_s;
  for (const double s : session_s) {
    offsets_s.push_back(TimeOffsetAt(camera, s));
  }
  return offsets_s;
}

}  // namespace

void Exposures::AddCamera(std::vector<KeyframeState> states) {
  cameras_.push_back({std::move(states), nullptr});
}

void Exposures::AddCamera(OfRow of_row) {
  cameras_.push_back({{}, std::move(of_row)});
}

std::vector<double> SessionTimes(const std::vector<KeyframeState>& keyframes,
                                 double age_s) {
  std::vector<double> session_s;
  for (const KeyframeState& x : keyframes) {
    session_s.push_back(age_s + 1e-9 * static_cast<double>(x.t_ns));
  }
  return session_s;
}

double KeyframeDelay(const Calibration& theta_true,
                     const Calibration& theta_slam,
                     double session_s) {
  double sum_s = 0;
  for (std::size_t j = 0; j < theta_true.cameras.size(); ++j) {
    sum_s += MiddleRowDelay(theta_true.cameras[j], session_s) -
             MiddleRowDelay(theta_slam.cameras[j], session_s);
  }
  return sum_s / static_cast<double>(theta_true.cameras.size());
}

TimeMargins ExposureMargins(const Calibration& theta_true,
                            const Calibration& theta_slam,
                            double age_s,
                            double duration_s) {
  TimeMargins margins;
  const auto include = [&](double dt_s) {
    margins.before_s = std::max(margins.before_s, -dt_s);
    margins.after_s = std::max(margins.after_s, dt_s);
  };
  // A keyframe is earlier by the clock of a second IMU, by its offset.
  if (theta_true.imu1) include(theta_true.imu1->time_offset_s);
  // Offsets are linear in time, and thus largest at either end.
  for (const double session_s : {age_s, age_s + duration_s}) {
    const auto include_image = [&](double dt_s,
                                   const CameraCalibration& camera) {
      const double first_row_s = dt_s + TimeOffsetAt(camera, session_s);
      include(first_row_s);
      include(first_row_s + RowDelay(camera, camera.height_px));
    };
    const double delay_s = KeyframeDelay(theta_true, theta_slam, session_s);
    include(delay_s);
    for (const CameraCalibration& camera : theta_true.cameras) {
      include_image(0, camera);
    }
    for (const CameraCalibration& camera : theta_slam.cameras) {
      include_image(delay_s, camera);
    }
  }
  return margins;
}

std::vector<KeyframeState> StatesLater(
    const std::vector<KeyframeState>& keyframes,
    const Trajectory& trajectory,
    const ImuReadings& imu,
    const std::vector<double>& dt_s) {
  std::vector<KeyframeState> states = keyframes;
  for (std::size_t k = 0; k < states.size(); ++k) {
    if (dt_s[k] == 0) continue;
    states[k] = StateLater(keyframes[k], trajectory, imu, dt_s[k]);
  }
  return states;
}

Exposures TrueExposures(const Calibration& theta_true,
                        const std::vector<KeyframeState>& keyframes,
                        const std::vector<double>& session_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  Exposures exposures;
  for (const CameraCalibration& camera : theta_true.cameras) {
    const std::vector<double> offsets_s = OffsetsAt(camera, session_s);
    if (!camera.line_delay_s) {
      exposures.AddCamera(StatesLater(keyframes, trajectory, imu, offsets_s));
      continue;
    }
    exposures.AddCamera([&, camera, offsets_s](int k, double row_px) {
      return StateLater(keyframes[k],
                        trajectory,
                        imu,
                        offsets_s[k] + RowDelay(camera, row_px));
    });
  }
  return exposures;
}

Exposures SlamExposures(const Calibration& theta_slam,
                        const std::vector<KeyframeState>& slam_states,
                        const std::vector<KeyframeState>& meant,
                        const std::vector<double>& session_s,
                        const std::vector<double>& delays_s,
                        const Trajectory& trajectory,
                        const ImuReadings& imu) {
  // The state of the SLAM system dt_s after that of a keyframe.
  const auto later = [&](std::size_t k, double dt_s) {
    const KeyframeState truth =
        TrueState(trajectory,
                  imu,
                  meant[k].t_ns + std::llround((delays_s[k] + dt_s) * 1e9));
    KeyframeState x = slam_states[k];
    const Eigen::Quaterniond q = x.q_GI * meant[k].q_GI.conjugate();
    x.p_GI += q * (truth.p_GI - meant[k].p_GI);
    x.q_GI = (q * truth.q_GI).normalized();
    return x;
  };
  Exposures exposures;
  for (const CameraCalibration& camera : theta_slam.cameras) {
    const std::vector<double> offsets_s = OffsetsAt(camera, session_s);
    if (camera.line_delay_s) {
      exposures.AddCamera([later, camera, offsets_s](int k, double row_px) {
        return later(k, offsets_s[k] + RowDelay(camera, row_px));
      });
      continue;
    }
    std::vector<KeyframeState> states = slam_states;
    for (std::size_t k = 0; k < meant.size(); ++k) {
      if (offsets_s[k] != 0) states[k] = later(k, offsets_s[k]);
    }
    exposures.AddCamera(std::move(states));
  }
  return exposures;
}

}  // namespace selfcal
