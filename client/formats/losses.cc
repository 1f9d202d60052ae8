#include "client/formats/losses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <span>
#include <type_traits>

#include "client/formats/tool_models.h"
#include "core/model/parameter_blocks.h"

namespace selfcal::client {

namespace {

// The blocks that every tool has that corrects readings.
constexpr std::string_view kMatrixBlocks[] = {"gyro.scale",
                                              "gyro.misalignment",
                                              "accel.scale",
                                              "accel.misalignment",
                                              "q_AI"};

// The names of the blocks that correct readings.
std::vector<std::string_view> Corrections(const ImuCalibration& imu) {
  std::vector<std::string_view> names;
  const ImuCalibration nominal;
  const auto visit = [&]<class Value>(const BlockInfo& info,
                                      const Value& value,
                                      const Value& without) {
    bool corrects;
    if constexpr (std::is_same_v<Value, OptionalVector>) {
      corrects = !value.isZero(0);  // absent ones are
    } else if constexpr (std::is_same_v<Value, Eigen::Quaterniond>) {
      corrects = !value.vec().isZero(0);
    } else {
      corrects = value != without;
    }
    if (corrects) names.push_back(info.name);
  };
  VisitSensorBlocks(kImuBlocks, visit, imu, nominal);
  return names;
}

bool Contains(std::span<const std::string_view> names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The last ray on the line from one pixel to another; nullopt if it has none.
std::optional<Eigen::Vector3d> LastRay(const CameraCalibration& camera,
                                       const Eigen::Vector2d& from_px,
                                       const Eigen::Vector2d& to_px) {
  constexpr int kHalvings = 30;
  std::optional<Eigen::Vector3d> last;
  const auto try_at = [&](double part) {
    Eigen::Vector3d bearing_C;
    const Eigen::Vector2d z_px = from_px + part * (to_px - from_px);
    if (!Unproject(camera, z_px, &bearing_C)) return false;
    last = bearing_C;
    return true;
  };
  if (try_at(1)) return last;
  double begin = 0, end = 1;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (begin + end) / 2;
    (try_at(middle) ? begin : end) = middle;
  }
  return last;
}

// Rays are furthest from the axis at the corners of the image, at the points of
// its border that are nearest to the principal point, or, where a fish-eye's
// circle ends within the image, on the way there.
bool ShowsRaysBeyond90Degrees(const CameraCalibration& camera) {
  const Eigen::Vector2d size(camera.width_px, camera.height_px);
  const Eigen::Vector2d c = camera.c.cwiseMax(0).cwiseMin(size);
  for (const double x : {0.0, c.x(), size.x()}) {
    for (const double y : {0.0, c.y(), size.y()}) {
      const auto ray_C = LastRay(camera, c, {x, y});
      if (ray_C && !(ray_C->z() > 0)) return true;
    }
  }
  return false;
}

}  // namespace

bool IsNominal(const ImuCalibration& imu) { return Corrections(imu).empty(); }

void AddImuLoss(const std::string& tool,
                const ImuCalibration& imu,
                std::vector<Loss>* losses) {
  if (IsNominal(imu)) return;
  losses->push_back(
      {"imu",
       fmt::format("{} uses the readings as they are: give it those that "
                   "CorrectImu computes with this calibration, both in frame "
                   "I (corrected: {})",
                   tool,
                   fmt::join(Corrections(imu), ", ")),
       true});
}

void AddImuBlockLosses(const std::string& tool,
                       std::initializer_list<std::string_view> has,
                       const std::string& name,
                       const ImuCalibration& imu,
                       std::vector<Loss>* losses) {
  for (const std::string_view block : Corrections(imu)) {
    if (Contains(kMatrixBlocks, block) || Contains(has, block)) continue;
    losses->push_back({fmt::format("{}.{}", name, block),
                       fmt::format("{} has no such correction: omitted", tool),
                       true});
  }
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
    if (camera.line_delay_s.value_or(0) == 0) continue;
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
    if (camera.time_drift.value_or(0) == 0) continue;
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
                      std::initializer_list<std::string_view> pinholes) {
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const CameraCalibration& camera = cameras[j];
    if (!Contains(pinholes, FindToolModel(tool, camera.model)->name) ||
        !ShowsRaysBeyond90Degrees(camera)) {
      continue;
    }
    losses->push_back(
        {fmt::format("cam{}.distortion", j),
         fmt::format("{} uses this model without the pixels of rays at 90 "
                     "degrees from the axis or beyond, which this image shows",
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
