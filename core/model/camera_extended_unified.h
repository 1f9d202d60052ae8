// The extended unified camera model of Khomutenko, Garcia and Martinet, "An
// enhanced unified camera model" (2016), with alpha and beta: a point is
// projected onto an ellipsoid, and from a point of the axis to a plane. With
// p_C = (X, Y, Z), d = (X, Y) / w,
//
//   w = alpha D + (1 - alpha) Z,   D = sqrt(beta (X^2 + Y^2) + Z^2).
//
// Derivatives, in the form of axial_camera.h:
//
//   a = alpha beta / D,   b = alpha Z / D + 1 - alpha,
//   dw/dalpha = D - Z,    dw/dbeta = alpha (X^2 + Y^2) / (2 D).
//
// Let phi = atan2(sqrt(beta) r, Z), r^2 = X^2 + Y^2: the radius of d is
// proportional to sin(phi) / (alpha + (1 - alpha) cos(phi)). Its slope has the
// sign of 1 - alpha + alpha cos(phi), so that the model is one-to-one where
//
//   alpha D + (1 - alpha) Z > 0   and   (1 - alpha) D + alpha Z > 0,
//
// the first being the narrower one up to alpha = 1/2, and the second above:
// rays beyond 90 degrees are inside. With q = beta |d|^2 and S = sqrt(1 + (1 -
// 2 alpha) q), the inverse is the ray
//
//   ( (alpha + (1 - alpha) S) d,   S - alpha (1 - alpha) q )
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
#include "core/simd/lanes.h"

namespace selfcal {

class ExtendedUnifiedAxis {
 public:
  static constexpr std::string_view kName = "extended-unified";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking. The usual values are
  // around those of EuRoC's lens in Basalt (0.59, 1.13), and of fish-eyes of up
  // to 195 degrees in Usenko et al. 2018.
  static constexpr CameraCoefficient kCoefficients[] = {{.name = "alpha",
                                                         .sigma_ref = 5e-3,
                                                         .valid = {-1, 1},
                                                         .usual = {0.5, 0.75}},
                                                        {.name = "beta",
                                                         .sigma_ref = 1e-2,
                                                         .valid = {0, 1e3},
                                                         .usual = {0.8, 1.3},
                                                         .undistorted = 1}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr",
       .name = "eucm",
       .distortion = "none",
       .before_pixels = 2},
      {.tool = "basalt", .name = "eucm", .coefficients = "alpha beta"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit ExtendedUnifiedAxis(std::span<const double, kSize> coefficients)
      : alpha_(coefficients[0]), beta_(coefficients[1]) {}

  template <typename T>
  auto Evaluate(const Eigen::Matrix<T, 3, 1>& p_C,
                AxialDistance<T, kSize>* axial) const {
    const T Z = p_C[2];
    const T r2 = p_C[0] * p_C[0] + p_C[1] * p_C[1];
    const T D2 = beta_ * r2 + Z * Z;
    const auto usable = UsableSquare(T(r2 + Z * Z)) && UsableSquare(D2);
    const T D = Sqrt(Select(usable, D2, T(1)));
    const T inverse_D = 1.0 / D;
    axial->w = alpha_ * D + (1 - alpha_) * Z;
    axial->a = alpha_ * beta_ * inverse_D;
    axial->b = alpha_ * inverse_D * Z + (1 - alpha_);
    axial->by_coefficients << D - Z, (alpha_ / 2) * r2 * inverse_D;
    return usable && axial->w >= kMinAxialRatio * D &&
           (1 - alpha_) * D + alpha_ * Z > T(0);
  }

  Eigen::Vector3d Ray(const Eigen::Vector2d& d) const {
    const double q = beta_ * d.squaredNorm();
    const double S = std::sqrt(1 + (1 - 2 * alpha_) * q);
    Eigen::Vector3d ray;
    ray << (alpha_ + (1 - alpha_) * S) * d, S - alpha_ * (1 - alpha_) * q;
    return ray;
  }

 private:
  double alpha_, beta_;
};

using CameraExtendedUnified = AxialCamera<ExtendedUnifiedAxis>;

}  // namespace selfcal
