// The FOV model of Devernay and Faugeras, "Straight lines have to be straight"
// (2001): one coefficient, the opening angle w [rad] of an ideal fish-eye.
//
//   r_d = atan(2 r_u tan(w/2)) / w,   d = (r_d / r_u) u,   0 <= |w| < pi.
//
// With A(w) = 2 tan(w/2) / w and q = 4 tan^2(w/2) r_u^2 it reads
//
//   d = s u,   s = A(w) g(q),   g(q) = atan(sqrt(q)) / sqrt(q),
//
// in which both limits are regular: A -> 1 as w -> 0 (no distortion), and
// g -> 1 as q -> 0 (the axis). The model is even in w. Derivatives, with
// t = tan(w/2), dt/dw = (1 + t^2) / 2 and A = h(w/2), h = tan(x)/x:
//
//   ds/d(r_u^2) = A g'(q) 4 t^2
//   ds/dw       = h'(w/2) / 2 g(q) + A g'(q) 4 t (1 + t^2) r_u^2
//   dd/du       = s I + 2 ds/d(r_u^2) u u^T
//   dd/dw       = ds/dw u
//
// r_d rises with r_u everywhere and tends to (pi/2) / w: the inverse
//
//   r_u = tan(r_d w) / (2 tan(w/2)) = r_d h(r_d w) / A(w)
//
// exists where r_d |w| < pi/2.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <span>

#include "core/model/distortion_series.h"

namespace selfcal {

struct DistortionFov {
  static constexpr int kSize = 1;

  // d = distort(u), with derivatives by u and by (w) unless null. Returns false
  // and sets nothing where the model is not defined.
  static bool Distort(std::span<const double, kSize> coefficients,
                      const Eigen::Vector2d& u,
                      Eigen::Vector2d* d,
                      Eigen::Matrix2d* d_by_u,
                      Eigen::Matrix<double, 2, kSize>* d_by_coefficients) {
    const double w = coefficients[0];
    if (!(std::abs(w) < std::numbers::pi)) return false;
    const double r2 = u.squaredNorm();
    const ValueAndDerivative A = TanRatio(w / 2);
    const double t = A.value * w / 2;
    const ValueAndDerivative g = AtanRatio(4 * t * t * r2);
    const double s = A.value * g.value;
    *d = s * u;
    if (d_by_u != nullptr) {
      const double s_by_r2 = A.value * g.derivative * 4 * t * t;
      *d_by_u = 2 * s_by_r2 * u * u.transpose();
      d_by_u->diagonal().array() += s;
    }
    if (d_by_coefficients != nullptr) {
      const double s_by_w = A.derivative / 2 * g.value +
                            A.value * g.derivative * 4 * t * (1 + t * t) * r2;
      *d_by_coefficients = s_by_w * u;
    }
    return true;
  }

  // The inverse of Distort. Returns false and sets nothing where there is none.
  static bool Undistort(std::span<const double, kSize> coefficients,
                        const Eigen::Vector2d& d,
                        Eigen::Vector2d* u) {
    const double w = coefficients[0];
    if (!(std::abs(w) < std::numbers::pi)) return false;
    const double angle = d.stableNorm() * std::abs(w);
    if (!(angle < std::numbers::pi / 2)) return false;
    *u = TanRatio(angle).value / TanRatio(w / 2).value * d;
    return true;
  }
};

}  // namespace selfcal
