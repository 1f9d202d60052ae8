// The double sphere model of Usenko, Demmel and Cremers, "The double sphere
// camera model" (2018), with xi and alpha: a point is projected onto a sphere,
// from there onto a second one whose centre is shifted by xi, and from a point
// of the axis to a plane. With p_C = (X, Y, Z), d = (X, Y) / w,
//
//   w = alpha d2 + (1 - alpha) k,   k = xi d1 + Z,
//   d1 = sqrt(X^2 + Y^2 + Z^2),     d2 = sqrt(X^2 + Y^2 + k^2).
//
// Derivatives, with c = dw/dk = alpha k / d2 + 1 - alpha, in the form of
// axial_camera.h:
//
//   a = alpha / d2 + c xi / d1,   b = c (xi Z / d1 + 1),
//   dw/dxi = c d1,                dw/dalpha = d2 - k.
//
// For |xi| < 1 the angle of (X, Y, k) from the axis increases with that of the
// ray, from 0 to 180 degrees; other values of xi are refused. The second step
// is that of the extended unified model with beta = 1, so that the model is
// one-to-one where
//
//   alpha d2 + (1 - alpha) k > 0   and   (1 - alpha) d2 + alpha k > 0,
//
// that is cos(theta) > -(xi (1 - s^2) + s sqrt(1 - xi^2 (1 - s^2))) with s the
// smaller one of alpha / (1 - alpha) and its inverse: rays beyond 90 degrees
// are inside. The condition of the paper, Z > -w2 d1, is the same for xi = 0
// only: for other values it excludes rays that have an image of their own, or
// admits some beyond this border. The inverse is the ray (m, n) of the second
// step,
//
//   m = (alpha + (1 - alpha) S) d,   n = S - alpha (1 - alpha) |d|^2,
//   S = sqrt(1 + (1 - 2 alpha) |d|^2),
//
// shifted back: (t m, t n - xi (m^2 + n^2)), t = xi n + sqrt(n^2 +
// (1 - xi^2) m^2).
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <iterator>
#include <span>
#include <string_view>

#include "core/model/axial_camera.h"
#include "core/model/camera_model.h"
#include "core/simd/lanes.h"

namespace selfcal {

class DoubleSphereAxis {
 public:
  static constexpr std::string_view kName = "double-sphere";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking. The usual values are
  // around those of TUM-VI's lenses in Basalt (-0.17, 0.59) and of the lenses
  // of Usenko et al. 2018.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "xi", .sigma_ref = 1e-2, .valid = {-1, 1}, .usual = {-0.3, 0.3}},
      {.name = "alpha",
       .sigma_ref = 3e-3,
       .valid = {-1, 1},
       .usual = {0.5, 0.75}}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr",
       .name = "ds",
       .distortion = "none",
       .before_pixels = 2},
      {.tool = "basalt", .name = "ds", .coefficients = "xi alpha"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit DoubleSphereAxis(std::span<const double, kSize> coefficients)
      : xi_(coefficients[0]),
        alpha_(coefficients[1]),
        valid_(std::abs(xi_) < 1) {}

  template <typename T>
  auto Evaluate(const Eigen::Matrix<T, 3, 1>& p_C,
                AxialDistance<T, kSize>* axial) const {
    const T Z = p_C[2];
    const T r2 = p_C[0] * p_C[0] + p_C[1] * p_C[1];
    const T square = r2 + Z * Z;
    const auto usable = UsableSquare(square) && T(valid_ ? 1 : 0) > T(0);
    const T d1 = Sqrt(Select(usable, square, T(1)));
    const T k = xi_ * d1 + Z;
    const T d2 = Sqrt(Select(usable, r2 + k * k, T(1)));
    const T inverse = 1.0 / (d1 * d2);
    const T inverse_d1 = inverse * d2;
    const T inverse_d2 = inverse * d1;
    const T c = alpha_ * inverse_d2 * k + (1 - alpha_);
    axial->w = alpha_ * d2 + (1 - alpha_) * k;
    axial->a = alpha_ * inverse_d2 + xi_ * inverse_d1 * c;
    axial->b = c * (xi_ * inverse_d1 * Z + 1.0);
    axial->by_coefficients << c * d1, d2 - k;
    return usable && axial->w >= kMinAxialRatio * d2 &&
           (1 - alpha_) * d2 + alpha_ * k > T(0);
  }

  Eigen::Vector3d Ray(const Eigen::Vector2d& d) const {
    const double q = d.squaredNorm();
    const double S = std::sqrt(1 + (1 - 2 * alpha_) * q);
    const Eigen::Vector2d m = (alpha_ + (1 - alpha_) * S) * d;
    const double n = S - alpha_ * (1 - alpha_) * q;
    const double m2 = m.squaredNorm();
    const double t = xi_ * n + std::sqrt(n * n + (1 - xi_ * xi_) * m2);
    Eigen::Vector3d ray;
    ray << t * m, t * n - xi_ * (m2 + n * n);
    return ray;
  }

 private:
  double xi_, alpha_;
  bool valid_;
};

using CameraDoubleSphere = AxialCamera<DoubleSphereAxis>;

}  // namespace selfcal
