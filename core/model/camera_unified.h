// The unified camera model of Mei and Rives, "Single view point omnidirectional
// camera calibration from planar grids" (2007), with xi and the coefficients
// k1 k2 p1 p2 of a radial-tangential distortion: a point is projected onto the
// unit sphere, from there to the plane at a distance of xi behind the sphere's
// centre, and distorted in that plane. With p_C = (X, Y, Z) and R = |p_C|,
//
//   u = (X, Y) / w,   w = Z + xi R,   d = distort(u)  (radial_tangential.h).
//
// Derivatives of u, in the form of axial_camera.h:
//
//   a = xi / R,   b = 1 + xi Z / R,   dw/dxi = R,
//
// and dd = dd/du du. The radius of u, sin(theta) / (cos(theta) + xi), increases
// with the angle theta of the ray from the axis where
//
//   Z + xi R > 0   and   R + xi Z > 0,
//
// that is cos(theta) > -min(xi, 1 / xi) for xi > 0: rays beyond 90 degrees are
// inside. The model is one-to-one where, in addition, distort is. The inverse
// is u = undistort(d) and, with q = |u|^2, the ray
//
//   ( (xi + S) u,   S - xi q ),   S = sqrt(1 + (1 - xi^2) q),
//
// if S is real.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <iterator>
#include <span>
#include <string_view>

#include "core/model/axial_camera.h"
#include "core/model/camera_model.h"
#include "core/model/distortion_radial_tangential.h"
#include "core/simd/lanes.h"

namespace selfcal {

class CameraUnified {
  static constexpr Interval kValid = {-1e3, 1e3};
  static constexpr Interval kTangential = {-2e-3, 2e-3};

 public:
  static constexpr std::string_view kName = "unified";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking. The usual values are
  // around those of a lens in Kalibr's documentation (0.67, -0.35, 0.16) and
  // of fish-eyes with xi above 1.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "xi", .sigma_ref = 5e-3, .valid = {-1, 1e3}, .usual = {0.5, 2}},
      {.name = "k1", .sigma_ref = 1e-2, .valid = kValid, .usual = {-0.4, 0.2}},
      {.name = "k2", .sigma_ref = 1e-2, .valid = kValid, .usual = {-0.1, 0.4}},
      {.name = "p1", .sigma_ref = 1e-3, .valid = kValid, .usual = kTangential},
      {.name = "p2", .sigma_ref = 1e-3, .valid = kValid, .usual = kTangential}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr",
       .name = "omni",
       .distortion = "radtan",
       .before_pixels = 1},
      {.tool = "vins_fusion",
       .name = "MEI",
       .coefficients = "mirror_parameters.xi distortion_parameters.k1 "
                       "distortion_parameters.k2 distortion_parameters.p1 "
                       "distortion_parameters.p2",
       .pixels = "projection_parameters.gamma1 projection_parameters.gamma2 "
                 "projection_parameters.u0 projection_parameters.v0"},
      {.tool = "maplab",
       .name = "unified-projection",
       .distortion = "radial-tangential",
       .before_pixels = 1}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit CameraUnified(std::span<const double, kSize> coefficients)
      : xi_(coefficients[0]), distortion_(coefficients.subspan<1>()) {}

  template <typename T>
  auto Project(const PixelMap& pixels,
               const Eigen::Matrix<T, 3, 1>& p_C,
               Eigen::Matrix<T, 2, 1>* z_px,
               ProjectionParts<T, kSize>* parts) const {
    AxialDistance<T, 1> axial;
    const auto on_sphere = Evaluate<T>(p_C, &axial);
    const T inverse = 1.0 / Select(on_sphere, axial.w, T(1));
    const Eigen::Matrix<T, 2, 1> u(Select(on_sphere, inverse * p_C[0], T(0)),
                                   Select(on_sphere, inverse * p_C[1], T(0)));
    Eigen::Matrix<T, 2, 1> d;
    if (parts == nullptr) {
      const auto valid =
          distortion_.template Distort<T>(u, &d, nullptr, nullptr);
      ToPixel<T, kSize>(pixels, d, z_px, nullptr);
      return on_sphere && valid;
    }
    Eigen::Matrix<T, 2, 2> d_by_u;
    Eigen::Matrix<T, 2, kSize - 1> d_by_k;
    const auto valid = distortion_.template Distort<T>(u, &d, &d_by_u, &d_by_k);
    Eigen::Matrix<T, 2, 3> u_by_point;
    Eigen::Matrix<T, 2, 1> u_by_xi;
    DifferentiateQuotient<T, 1>(p_C, axial, u, inverse, &u_by_point, &u_by_xi);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 3; ++j) {
        parts->point(i, j) =
            d_by_u(i, 0) * u_by_point(0, j) + d_by_u(i, 1) * u_by_point(1, j);
      }
      parts->distortion(i, 0) =
          d_by_u(i, 0) * u_by_xi[0] + d_by_u(i, 1) * u_by_xi[1];
      for (int j = 1; j < kSize; ++j) {
        parts->distortion(i, j) = d_by_k(i, j - 1);
      }
    }
    ToPixel<T, kSize>(pixels, d, z_px, parts);
    return on_sphere && valid;
  }

  bool Unproject(const Eigen::Vector2d& d, Eigen::Vector3d* ray_C) const {
    Eigen::Vector2d u;
    if (!distortion_.Undistort(d, &u)) return false;
    const double q = u.squaredNorm();
    const double S = std::sqrt(1 + (1 - xi_ * xi_) * q);
    Eigen::Vector3d ray;
    ray << (xi_ + S) * u, S - xi_ * q;
    AxialDistance<double, 1> axial;
    if (!Evaluate<double>(ray, &axial)) return false;
    *ray_C = ray;
    return true;
  }

 private:
  // w with its derivatives, and whether u increases up to the point.
  template <typename T>
  typename LaneTraits<T>::Mask Evaluate(const Eigen::Matrix<T, 3, 1>& p_C,
                                        AxialDistance<T, 1>* axial) const {
    const T Z = p_C[2];
    const T square = p_C[0] * p_C[0] + p_C[1] * p_C[1] + Z * Z;
    const auto usable = UsableSquare(square);
    const T R = Sqrt(Select(usable, square, T(1)));
    const T xi_by_R = xi_ / R;
    axial->w = Z + xi_ * R;
    axial->a = xi_by_R;
    axial->b = 1.0 + xi_by_R * Z;
    axial->by_coefficients[0] = R;
    return usable && axial->w >= kMinAxialRatio * R && R + xi_ * Z > T(0);
  }

  double xi_;
  DistortionRadialTangential distortion_;
};

}  // namespace selfcal
