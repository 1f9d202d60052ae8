#include "client/formats/losses.h"

#include <fmt/format.h>

#include "client/formats/tool_models.h"

namespace selfcal::client {

bool IsNominal(const ImuCalibration& imu) {
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  return imu.T_g() == one && imu.T_a() == one && imu.q_AI.vec().isZero(0) &&
         imu.gyro_g_sensitivity.isZero(0) && imu.accel_position.isZero(0);
}

void AddImuLoss(const std::string& tool,
                const ImuCalibration& imu,
                std::vector<Loss>* losses) {
  if (IsNominal(imu)) return;
  losses->push_back(
      {"imu",
       fmt::format("{} uses the readings as they are: give it those that "
                   "CorrectImu computes with this calibration (scales, "
                   "misalignments, q_AI, g-sensitivity and the position of the "
                   "accelerometer removed, both in frame I)",
                   tool),
       true});
}

void AddGSensitivityLoss(const std::string& tool,
                         const ImuCalibration& imu,
                         std::vector<Loss>* losses) {
  if (imu.gyro_g_sensitivity.isZero(0)) return;
  losses->push_back({"imu.gyro.g_sensitivity",
                     fmt::format("{} has no sensitivity of the gyroscope to "
                                 "acceleration: omitted",
                                 tool),
                     true});
}

void AddPositionLoss(const std::string& tool,
                     const ImuCalibration& imu,
                     std::vector<Loss>* losses) {
  if (imu.accel_position.isZero(0)) return;
  losses->push_back(
      {"imu.accel.position",
       fmt::format("{} has the accelerometer at the origin of the "
                   "IMU: omitted",
                   tool),
       true});
}

void AddTimeOffsetLosses(const std::string& tool,
                         const Calibration& theta,
                         std::vector<Loss>* losses) {
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const double offset_s = theta.cameras[j].time_offset_s;
    if (offset_s == 0) continue;
    losses->push_back(
        {fmt::format("cam{}.time_offset", j),
         fmt::format("{} has no time offset: add {} s to the timestamps of its "
                     "images",
                     tool,
                     offset_s),
         true});
  }
}

void AddSharedOffsetLosses(const std::string& tool,
                           const Calibration& theta,
                           std::vector<Loss>* losses) {
  for (std::size_t j = 1; j < theta.cameras.size(); ++j) {
    const double more_s =
        theta.cameras[j].time_offset_s - theta.cameras[0].time_offset_s;
    if (more_s == 0) continue;
    losses->push_back(
        {fmt::format("cam{}.time_offset", j),
         fmt::format("{} has one time offset, that of cam0: add {} s to the "
                     "timestamps of cam{}",
                     tool,
                     more_s,
                     j),
         true});
  }
}

void AddLineDelayLosses(const std::string& tool,
                        const Calibration& theta,
                        std::vector<Loss>* losses) {
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const CameraCalibration& camera = theta.cameras[j];
    if (!camera.line_delay_s) continue;
    losses->push_back(
        {fmt::format("cam{}.line_delay", j),
         fmt::format("{} exposes all rows of an image at once: add {} s to the "
                     "timestamps of its images, so that they are those of the "
                     "middle row, which is right for this row alone",
                     tool,
                     *camera.line_delay_s * camera.height_px / 2),
         true});
  }
}

void AddTimeDriftLosses(const std::string& tool,
                        const Calibration& theta,
                        std::vector<Loss>* losses) {
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const CameraCalibration& camera = theta.cameras[j];
    if (!camera.time_drift) continue;
    losses->push_back(
        {fmt::format("cam{}.time_drift", j),
         fmt::format("{} has a constant time offset, while this one is that of "
                     "the begin of a session and grows by {} s each second: "
                     "add this to the timestamps of its images",
                     tool,
                     *camera.time_drift),
         true});
  }
}

void AddPinholeLosses(const std::string& tool,
                      const std::vector<CameraCalibration>& cameras,
                      std::vector<Loss>* losses,
                      std::string_view pinhole) {
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const CameraCalibration& camera = cameras[j];
    if (FindToolModel(tool, camera.model)->name != pinhole) continue;
    const auto beyond = [&](double x, double y) {
      Eigen::Vector3d bearing_C;
      return Unproject(camera, {x, y}, &bearing_C) && !(bearing_C.z() > 0);
    };
    const double right = camera.width_px, bottom = camera.height_px;
    const Eigen::Vector2d& c = camera.c;
    if (!beyond(0, 0) && !beyond(right, 0) && !beyond(0, bottom) &&
        !beyond(right, bottom) && !beyond(0, c.y()) && !beyond(right, c.y()) &&
        !beyond(c.x(), 0) && !beyond(c.x(), bottom)) {
      continue;
    }
    losses->push_back(
        {fmt::format("cam{}.distortion", j),
         fmt::format("{} has this model as a pinhole, without the pixels of "
                     "rays at 90 degrees from the axis or beyond, which this "
                     "image shows",
                     tool),
         true});
  }
}

void AddGravityLoss(const std::string& tool,
                    const Rig& rig,
                    std::vector<Loss>* losses) {
  if (rig.gravity_mps2 == Rig().gravity_mps2) return;
  losses->push_back({"gravity",
                     fmt::format("{} does not read it from these files; that "
                                 "of the rig is {} m/s^2",
                                 tool,
                                 rig.gravity_mps2),
                     false});
}

void KeepCameras(const std::string& tool,
                 std::size_t count,
                 Calibration* theta,
                 std::vector<Loss>* losses) {
  for (std::size_t j = count; j < theta->cameras.size(); ++j) {
    losses->push_back(
        {fmt::format("cam{}", j),
         fmt::format("{} has at most {} cameras: omitted", tool, count),
         true});
  }
  if (theta->cameras.size() > count) theta->cameras.resize(count);
}

double ImuRate(const FormatOptions& options,
               const std::string& field,
               std::vector<Loss>* losses) {
  if (options.imu_rate_hz) return *options.imu_rate_hz;
  constexpr double kUsual_hz = 200;
  losses->push_back({"imu_rate",
                     fmt::format("{} is assumed to be {} Hz, because selfcal "
                                 "does not know it: set --imu-rate",
                                 field,
                                 kUsual_hz),
                     false});
  return kUsual_hz;
}

}  // namespace selfcal::client
