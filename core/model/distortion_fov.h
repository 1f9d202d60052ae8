// The FOV model of Devernay and Faugeras, "Straight lines have to be straight"
// (2001): one coefficient, the opening angle w [rad] of an ideal fish-eye.
//
//   r_d = atan(2 r_u tan(w/2)) / w,   d = (r_d / r_u) u,   0 <= |w| < pi.
//
// With A(w) = 2 tan(w/2) / w and q = 4 tan^2(w/2) r_u^2 this is
//
//   d = s u,   s = A(w) g(q),   g(q) = atan(sqrt(q)) / sqrt(q),
//
// with regular limits: A -> 1 as w -> 0 (no distortion), and g -> 1 as q -> 0
// (the axis). The model is even in w. Derivatives, with t = tan(w/2),
// dt/dw = (1 + t^2) / 2 and A = h(w/2), h = tan(x)/x:
//
//   ds/d(r_u^2) = A g'(q) 4 t^2
//   ds/dw       = h'(w/2) / 2 g(q) + A g'(q) 4 t (1 + t^2) r_u^2
//   dd/du       = s I + 2 ds/d(r_u^2) u u^T
//   dd/dw       = ds/dw u
//
// r_d increases with r_u everywhere and tends to (pi/2) / w: the inverse
//
//   r_u = tan(r_d w) / (2 tan(w/2)) = r_d h(r_d w) / A(w)
//
// exists where r_d |w| < pi/2.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>
#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/distortion_series.h"

namespace selfcal {

class DistortionFov {
 public:
  static constexpr std::string_view kName = "fov";
  // sigma_ref: of 22 moving segments of a hand-held recording with such a
  // camera.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "w",
       .sigma_ref = 2.7e-3,
       .valid = {-std::numbers::pi, std::numbers::pi},
       .usual = {-1.3, 1.3}}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr", .name = "pinhole", .distortion = "fov"},
      {.tool = "maplab", .name = "pinhole", .distortion = "fisheye"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit DistortionFov(std::span<const double, kSize> coefficients)
      : DistortionFov(coefficients[0]) {}
  explicit DistortionFov(double w)
      : w_(w),
        valid_(std::abs(w) < std::numbers::pi),
        A_(TanRatio(valid_ ? w / 2 : 0)),
        t_(A_.value * w / 2) {}

  // Computes d = distort(u), and its derivatives with respect to u and (w)
  // unless these are null. Returns false where the model is not defined; the
  // outputs are then meaningless. T is double or Lanes.
  template <typename T>
  auto Distort(const Eigen::Matrix<T, 2, 1>& u,
               Eigen::Matrix<T, 2, 1>* d,
               Eigen::Matrix<T, 2, 2>* d_by_u,
               Eigen::Matrix<T, 2, kSize>* d_by_coefficients) const {
    const T r2 = u[0] * u[0] + u[1] * u[1];
    const double q_by_r2 = 4 * t_ * t_;
    const ValueAndDerivative<T> g = AtanRatio<T>(q_by_r2 * r2);
    const T s = A_.value * g.value;
    *d = s * u;
    if (d_by_u != nullptr) {
      const T twice_s_by_r2 = 2 * A_.value * q_by_r2 * g.derivative;
      const T off_diagonal = twice_s_by_r2 * u[0] * u[1];
      *d_by_u << s + twice_s_by_r2 * u[0] * u[0], off_diagonal, off_diagonal,
          s + twice_s_by_r2 * u[1] * u[1];
    }
    if (d_by_coefficients != nullptr) {
      const T s_by_w = A_.derivative / 2 * g.value +
                       A_.value * (4 * t_ * (1 + t_ * t_)) * g.derivative * r2;
      *d_by_coefficients = s_by_w * u;
    }
    return T(valid_ ? 1 : 0) > T(0);
  }

  // Inverse of Distort. Returns false and sets nothing where there is none.
  bool Undistort(const Eigen::Vector2d& d, Eigen::Vector2d* u) const {
    const double angle = d.stableNorm() * std::abs(w_);
    if (!(valid_ && angle < std::numbers::pi / 2)) return false;
    *u = TanRatio(angle).value / A_.value * d;
    return true;
  }

 private:
  double w_;
  bool valid_;
  ValueAndDerivative<double> A_;
  double t_;  // tan(w / 2)
};

}  // namespace selfcal
