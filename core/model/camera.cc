#include "core/model/camera.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "core/model/camera_models.h"

namespace selfcal {
namespace {

// Parameters up to this cannot overflow; no physical value is larger.
constexpr double kMaxParameter = 1e9;

// Returns false for NaN.
bool Usable(double value) { return std::abs(value) <= kMaxParameter; }

bool UsableParameters(const CameraCalibration& camera) {
  bool usable = Usable(camera.f.x()) && Usable(camera.f.y()) &&
                Usable(camera.c.x()) && Usable(camera.c.y());
  for (const double coefficient : camera.distortion) {
    usable = usable && Usable(coefficient);
  }
  return usable;
}

template <class... Models>
constexpr auto ModelsOf(CameraModelList<Models...>) {
  std::array<DistortionModel, sizeof...(Models)> models;
  for (std::size_t i = 0; i < models.size(); ++i) {
    models[i] = static_cast<DistortionModel>(i);
  }
  return models;
}

template <class... Models>
constexpr auto InfosOf(CameraModelList<Models...>) {
  return std::array<CameraModelInfo, sizeof...(Models)>{
      CameraModelInfo{Models::kName, Models::kCoefficients, Models::kTools}...};
}

}  // namespace

int DistortionSize(DistortionModel model) {
  return static_cast<int>(ModelInfo(model).coefficients.size());
}

std::string_view DistortionName(DistortionModel model) {
  return ModelInfo(model).name;
}

std::span<const DistortionModel> DistortionModels() {
  static constexpr auto kModels = ModelsOf(CameraModels());
  return kModels;
}

const CameraModelInfo& ModelInfo(DistortionModel model) {
  static constexpr auto kInfos = InfosOf(CameraModels());
  return kInfos.at(static_cast<std::size_t>(model));
}

DistortionVector Undistorted(DistortionModel model) {
  const auto coefficients = ModelInfo(model).coefficients;
  DistortionVector values(coefficients.size());
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    values[static_cast<Eigen::Index>(i)] = coefficients[i].undistorted;
  }
  return values;
}

bool Project(const CameraCalibration& camera,
             const Eigen::Vector3d& p_C,
             Eigen::Vector2d* z_px,
             ProjectionJacobians* jacobians) {
  if (!UsableParameters(camera)) return false;
  const PixelMap pixels = PixelMapOf(camera);
  return VisitCameraModel(camera, [&](const auto& model) {
    constexpr int kSize = std::decay_t<decltype(model)>::kSize;
    Eigen::Vector2d z;
    if (jacobians == nullptr) {
      if (!model.template Project<double>(pixels, p_C, &z, nullptr)) {
        return false;
      }
      *z_px = z;
      return true;
    }
    ProjectionParts<double, kSize> parts;
    if (!model.template Project<double>(pixels, p_C, &z, &parts)) return false;
    *z_px = z;
    jacobians->point = parts.point;
    jacobians->intrinsics.resize(2, 4 + kSize);
    jacobians->intrinsics.leftCols<2>() = parts.d.asDiagonal();
    jacobians->intrinsics.middleCols<2>(2).setIdentity();
    jacobians->intrinsics.rightCols<kSize>() = parts.distortion;
    return true;
  });
}

bool Unproject(const CameraCalibration& camera,
               const Eigen::Vector2d& z_px,
               Eigen::Vector3d* bearing_C) {
  if (!UsableParameters(camera)) return false;
  const Eigen::Vector2d d = (z_px - camera.c).cwiseQuotient(camera.f);
  if (!d.allFinite()) return false;
  Eigen::Vector3d ray_C;
  const bool inverted = VisitCameraModel(
      camera, [&](const auto& model) { return model.Unproject(d, &ray_C); });
  if (!inverted) return false;
  *bearing_C = ray_C.normalized();
  return true;
}

double TimeOffsetAt(const CameraCalibration& camera, double session_s) {
  return camera.time_offset_s + camera.time_drift.value_or(0) * session_s;
}

double MiddleRowDelay(const CameraCalibration& camera, double session_s) {
  return TimeOffsetAt(camera, session_s) +
         camera.line_delay_s.value_or(0) * camera.height_px / 2;
}

Eigen::Vector2d PixelsPerRadian(const CameraCalibration& camera) {
  Eigen::Vector2d z_px;
  ProjectionJacobians jacobians;
  if (!Project(camera, Eigen::Vector3d::UnitZ(), &z_px, &jacobians)) {
    return camera.f;
  }
  return jacobians.point.leftCols<2>().diagonal();
}

}  // namespace selfcal
