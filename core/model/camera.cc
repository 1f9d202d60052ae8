#include "core/model/camera.h"

#include <cmath>
#include <span>

#include "core/model/distortion_equidistant.h"
#include "core/model/distortion_fov.h"
#include "core/model/distortion_radial_tangential.h"

namespace selfcal {
namespace {

// A ray within about this angle [rad] of the camera plane is not seen.
constexpr double kMinDepthRatio = 1e-6;
// Depths and parameters between these bounds cannot overflow in a projection
// or in its derivatives; nothing physical is outside, in any unit.
constexpr double kMinDepth = 1e-100;
constexpr double kMaxDepth = 1e100;
constexpr double kMaxParameter = 1e9;

// Calls visit(model) with the static interface of the camera's model. Returns
// false for a number of coefficients that is not the model's.
template <class Visitor>
bool Dispatch(const CameraCalibration& camera, const Visitor& visit) {
  if (camera.distortion.size() != DistortionSize(camera.model)) return false;
  switch (camera.model) {
    case DistortionModel::kFov:
      return visit(DistortionFov());
    case DistortionModel::kRadialTangential:
      return visit(DistortionRadialTangential());
    case DistortionModel::kEquidistant:
      return visit(DistortionEquidistant());
  }
  return false;
}

template <class Model>
std::span<const double, Model::kSize> Coefficients(
    const CameraCalibration& camera) {
  return std::span<const double, Model::kSize>(camera.distortion.data(),
                                               Model::kSize);
}

// These two are false for NaN.
bool Usable(double value) { return std::abs(value) <= kMaxParameter; }

// Whether a ray through (xy, depth) is clear of the camera plane.
bool InFront(const Eigen::Vector2d& xy, double depth) {
  return std::abs(xy.x()) * kMinDepthRatio <= depth &&
         std::abs(xy.y()) * kMinDepthRatio <= depth;
}

bool UsableParameters(const CameraCalibration& camera) {
  bool usable = Usable(camera.f.x()) && Usable(camera.f.y()) &&
                Usable(camera.c.x()) && Usable(camera.c.y());
  for (const double coefficient : camera.distortion) {
    usable = usable && Usable(coefficient);
  }
  return usable;
}

template <class Model>
bool ProjectWith(const CameraCalibration& camera,
                 const Eigen::Vector3d& p_C,
                 Eigen::Vector2d* z_px,
                 ProjectionJacobians* jacobians) {
  const double inverse_depth = 1 / p_C.z();
  const Eigen::Vector2d u = inverse_depth * p_C.head<2>();
  Eigen::Vector2d d;
  if (jacobians == nullptr) {
    if (!Model::Distort(Coefficients<Model>(camera), u, &d, nullptr, nullptr)) {
      return false;
    }
    *z_px = camera.f.cwiseProduct(d) + camera.c;
    return true;
  }

  Eigen::Matrix2d d_by_u;
  Eigen::Matrix<double, 2, Model::kSize> d_by_coefficients;
  if (!Model::Distort(
          Coefficients<Model>(camera), u, &d, &d_by_u, &d_by_coefficients)) {
    return false;
  }
  *z_px = camera.f.cwiseProduct(d) + camera.c;
  const auto F = camera.f.asDiagonal();
  jacobians->point.leftCols<2>() = inverse_depth * (F * d_by_u);
  jacobians->point.col(2) = -(jacobians->point.leftCols<2>() * u);
  jacobians->intrinsics.resize(2, 4 + Model::kSize);
  jacobians->intrinsics.template leftCols<2>() = d.asDiagonal();
  jacobians->intrinsics.template middleCols<2>(2).setIdentity();
  jacobians->intrinsics.template rightCols<Model::kSize>() =
      F * d_by_coefficients;
  return true;
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
  const double z = p_C.z();
  if (!(z >= kMinDepth && z <= kMaxDepth)) return false;
  if (!InFront(p_C.head<2>(), z)) return false;
  if (!UsableParameters(camera)) return false;
  return Dispatch(camera, [&](auto model) {
    return ProjectWith<decltype(model)>(camera, p_C, z_px, jacobians);
  });
}

bool Unproject(const CameraCalibration& camera,
               const Eigen::Vector2d& z_px,
               Eigen::Vector3d* bearing_C) {
  if (!UsableParameters(camera)) return false;
  const Eigen::Vector2d d = (z_px - camera.c).cwiseQuotient(camera.f);
  if (!d.allFinite()) return false;
  Eigen::Vector2d u;
  const bool inverted = Dispatch(camera, [&](auto model) {
    using Model = decltype(model);
    return Model::Undistort(Coefficients<Model>(camera), d, &u);
  });
  if (!inverted) return false;
  if (!InFront(u, 1)) return false;
  *bearing_C = u.homogeneous().normalized();
  return true;
}

}  // namespace selfcal
