// A pinhole with one of the distortion models, as a camera model: a point p_C
// with the normalised coordinates u = (x/z, y/z) has the distorted ones
// d = distort(u). Rays at 90 degrees from the axis and beyond have no image.
#pragma once

#include <Eigen/Core>
#include <span>

#include "core/model/camera_model.h"
#include "core/simd/lanes.h"

namespace selfcal {

template <class Distortion>
class Pinhole {
 public:
  static constexpr int kSize = Distortion::kSize;
  static constexpr std::string_view kName = Distortion::kName;
  static constexpr std::span<const CameraCoefficient> kCoefficients =
      Distortion::kCoefficients;
  static constexpr std::span<const ToolModel> kTools = Distortion::kTools;

  explicit Pinhole(std::span<const double, kSize> coefficients)
      : distortion_(coefficients) {}

  // Projects p_C to *z_px, and fills *parts unless it is null. Returns false
  // where Project() of camera.h does; the outputs are then meaningless. The
  // parameters of the camera are not checked. T is double or Lanes.
  template <typename T>
  auto Project(const PixelMap& pixels,
               const Eigen::Matrix<T, 3, 1>& p_C,
               Eigen::Matrix<T, 2, 1>* z_px,
               ProjectionParts<T, kSize>* parts) const {
    const T depth = p_C[2];
    // These comparisons are false for NaN.
    const auto in_front = depth >= T(kMinDepth) && depth <= T(kMaxDepth) &&
                          Abs(p_C[0]) * kMinDepthRatio <= depth &&
                          Abs(p_C[1]) * kMinDepthRatio <= depth;
    const T inverse_depth = 1.0 / Select(in_front, depth, T(1));
    const Eigen::Matrix<T, 2, 1> u(inverse_depth * p_C[0],
                                   inverse_depth * p_C[1]);
    const T fx(pixels.f[0]), fy(pixels.f[1]);
    Eigen::Matrix<T, 2, 1> d;
    if (parts == nullptr) {
      const auto valid =
          distortion_.template Distort<T>(u, &d, nullptr, nullptr);
      *z_px << fx * d[0] + pixels.c[0], fy * d[1] + pixels.c[1];
      return in_front && valid;
    }
    Eigen::Matrix<T, 2, 2> d_by_u;
    const auto valid =
        distortion_.template Distort<T>(u, &d, &d_by_u, &parts->distortion);
    *z_px << fx * d[0] + pixels.c[0], fy * d[1] + pixels.c[1];
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

  // Computes a ray in C, of any length, to which d = (z - c) / f belongs.
  // Returns false and sets nothing where there is none.
  bool Unproject(const Eigen::Vector2d& d, Eigen::Vector3d* ray_C) const {
    Eigen::Vector2d u;
    if (!distortion_.Undistort(d, &u)) return false;
    if (!(u.cwiseAbs().maxCoeff() * kMinDepthRatio <= 1)) return false;
    *ray_C = u.homogeneous();
    return true;
  }

 private:
  // A ray within about this angle [rad] of the camera plane is not visible.
  static constexpr double kMinDepthRatio = 1e-6;

  Distortion distortion_;
};

}  // namespace selfcal
