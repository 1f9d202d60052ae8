// The projection of camera.h as a template over the scalar, for one point or
// for several at once, and over the distortion model, which is prepared once
// for many points. Internal to core/model and core/factor.
#pragma once

#include <Eigen/Core>
#include <span>

#include "core/model/camera.h"
#include "core/model/distortion_equidistant.h"
#include "core/model/distortion_fov.h"
#include "core/model/distortion_radial_tangential.h"
#include "core/simd/lanes.h"

namespace selfcal {

// A ray within about this angle [rad] of the camera plane is not visible.
inline constexpr double kMinDepthRatio = 1e-6;
// Depths between these bounds cannot cause overflow in a projection or its
// derivatives; no physical depth is outside, in any unit.
inline constexpr double kMinDepth = 1e-100;
inline constexpr double kMaxDepth = 1e100;

// Calls visit(model) with the camera's distortion model, prepared from its
// coefficients. Returns a default value if the number of coefficients does not
// match the model.
template <class Visitor>
auto VisitDistortion(const CameraCalibration& camera, const Visitor& visit)
    -> decltype(visit(DistortionFov(0.0))) {
  const auto coefficients = [&]<class Model>() {
    return std::span<const double, Model::kSize>(camera.distortion.data(),
                                                 Model::kSize);
  };
  if (camera.distortion.size() != DistortionSize(camera.model)) return {};
  switch (camera.model) {
    case DistortionModel::kFov:
      return visit(
          DistortionFov(coefficients.template operator()<DistortionFov>()));
    case DistortionModel::kRadialTangential:
      return visit(DistortionRadialTangential(
          coefficients.template operator()<DistortionRadialTangential>()));
    case DistortionModel::kEquidistant:
      return visit(DistortionEquidistant(
          coefficients.template operator()<DistortionEquidistant>()));
  }
  return {};
}

// Parameters of z = f d + c as plain numbers.
struct Pinhole {
  double f[2];
  double c[2];
};
inline Pinhole PinholeOf(const CameraCalibration& camera) {
  return {{camera.f.x(), camera.f.y()}, {camera.c.x(), camera.c.y()}};
}

// Parts of the derivatives of a pixel z = f d + c. The derivative with respect
// to f is diagonal with d; the one with respect to c is the identity.
template <typename T, int kSize>
struct ProjectionParts {
  Eigen::Matrix<T, 2, 1> d;               // distorted coordinates
  Eigen::Matrix<T, 2, 3> point;           // dz / dp_C
  Eigen::Matrix<T, 2, kSize> distortion;  // dz / d coefficients
};

// Projects p_C to *z_px, and fills *parts unless it is null. Returns false
// where Project() of camera.h does; the outputs are then meaningless. The
// parameters of the camera are not checked.
template <typename T, class Model>
auto ProjectWith(const Pinhole& pinhole,
                 const Model& model,
                 const Eigen::Matrix<T, 3, 1>& p_C,
                 Eigen::Matrix<T, 2, 1>* z_px,
                 ProjectionParts<T, Model::kSize>* parts) {
  const T depth = p_C[2];
  // These comparisons are false for NaN.
  const auto in_front = depth >= T(kMinDepth) && depth <= T(kMaxDepth) &&
                        Abs(p_C[0]) * kMinDepthRatio <= depth &&
                        Abs(p_C[1]) * kMinDepthRatio <= depth;
  const T inverse_depth = 1.0 / Select(in_front, depth, T(1));
  const Eigen::Matrix<T, 2, 1> u(inverse_depth * p_C[0],
                                 inverse_depth * p_C[1]);
  const T fx(pinhole.f[0]), fy(pinhole.f[1]);
  Eigen::Matrix<T, 2, 1> d;
  if (parts == nullptr) {
    const auto valid = model.template Distort<T>(u, &d, nullptr, nullptr);
    *z_px << fx * d[0] + pinhole.c[0], fy * d[1] + pinhole.c[1];
    return in_front && valid;
  }
  Eigen::Matrix<T, 2, 2> d_by_u;
  const auto valid =
      model.template Distort<T>(u, &d, &d_by_u, &parts->distortion);
  *z_px << fx * d[0] + pinhole.c[0], fy * d[1] + pinhole.c[1];
  parts->d = d;
  parts->distortion.row(0) *= fx;
  parts->distortion.row(1) *= fy;
  for (int i = 0; i < 2; ++i) {
    const T scale = inverse_depth * (i == 0 ? fx : fy);
    parts->point(i, 0) = scale * d_by_u(i, 0);
    parts->point(i, 1) = scale * d_by_u(i, 1);
    parts->point(i, 2) =
        -(parts->point(i, 0) * u[0] + parts->point(i, 1) * u[1]);
  }
  return in_front && valid;
}

}  // namespace selfcal
