#include "core/model/camera.h"

#include <cmath>
#include <type_traits>

#include "core/model/projection.h"

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

}  // namespace

int DistortionSize(DistortionModel model) {
  switch (model) {
    case DistortionModel::kFov:
      return DistortionFov::kSize;
    case DistortionModel::kRadialTangential:
      return DistortionRadialTangential::kSize;
    case DistortionModel::kEquidistant:
      return DistortionEquidistant::kSize;
  }
  return 0;
}

std::string_view DistortionName(DistortionModel model) {
  switch (model) {
    case DistortionModel::kFov:
      return "fov";
    case DistortionModel::kRadialTangential:
      return "radial-tangential";
    case DistortionModel::kEquidistant:
      return "equidistant";
  }
  return "unknown";
}

bool Project(const CameraCalibration& camera,
             const Eigen::Vector3d& p_C,
             Eigen::Vector2d* z_px,
             ProjectionJacobians* jacobians) {
  if (!UsableParameters(camera)) return false;
  const Pinhole pinhole = PinholeOf(camera);
  return VisitDistortion(camera, [&](const auto& model) {
    constexpr int kSize = std::decay_t<decltype(model)>::kSize;
    Eigen::Vector2d z;
    if (jacobians == nullptr) {
      if (!ProjectWith<double>(pinhole, model, p_C, &z, nullptr)) return false;
      *z_px = z;
      return true;
    }
    ProjectionParts<double, kSize> parts;
    if (!ProjectWith<double>(pinhole, model, p_C, &z, &parts)) return false;
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
  Eigen::Vector2d u;
  const bool inverted = VisitDistortion(
      camera, [&](const auto& model) { return model.Undistort(d, &u); });
  if (!inverted) return false;
  if (!(u.cwiseAbs().maxCoeff() * kMinDepthRatio <= 1)) return false;
  *bearing_C = u.homogeneous().normalized();
  return true;
}

}  // namespace selfcal
