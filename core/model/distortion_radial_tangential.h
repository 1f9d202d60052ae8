// The radial-tangential model of Brown, "Close-range camera calibration"
// (1971), with two radial coefficients and two tangential ones, k1 k2 p1 p2.
// With u = (x, y), r^2 = x^2 + y^2 and L = 1 + k1 r^2 + k2 r^4:
//
//   d_x = x L + 2 p1 x y + p2 (r^2 + 2 x^2)
//   d_y = y L + 2 p2 x y + p1 (r^2 + 2 y^2)
//
// Derivatives, with L' = dL/d(r^2) = k1 + 2 k2 r^2:
//
//   dd/du = L I + 2 L' u u^T + [ 2 p1 y + 6 p2 x   2 p1 x + 2 p2 y ]
//                              [ 2 p1 x + 2 p2 y   6 p1 y + 2 p2 x ]
//   dd/dk = ( r^2 u,  r^4 u,  (2 x y, r^2 + 2 y^2),  (r^2 + 2 x^2, 2 x y) )
//
// dd/du is symmetric: d is the gradient of a potential, and the model is
// one-to-one on a convex region in which dd/du is positive definite. Without
// tangential terms its eigenvalues are L and the slope of the radial profile,
// 1 + 3 k1 r^2 + 5 k2 r^4, and the region is the disc up to the first zero of
// the slope. The tangential terms of a real lens move its edge a little; so a
// point is valid if the profile rises all the way to it and dd/du at the point
// is positive definite.
//
// The inverse has no closed form. Newton's method on d(u) = d, started on the
// axis, with steps halved until they stay in the region and lower the error:
// the error falls at every step, so the iteration ends, also for a d without
// an inverse, against the edge of the region.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <span>

#include "core/model/monotonic.h"

namespace selfcal {

struct DistortionRadialTangential {
  static constexpr int kSize = 4;

  // d = distort(u), with derivatives by u and by (k1, k2, p1, p2) unless null.
  // Returns false and sets nothing where the model is not one-to-one.
  static bool Distort(std::span<const double, kSize> coefficients,
                      const Eigen::Vector2d& u,
                      Eigen::Vector2d* d,
                      Eigen::Matrix2d* d_by_u,
                      Eigen::Matrix<double, 2, kSize>* d_by_coefficients) {
    const double k1 = coefficients[0];
    const double k2 = coefficients[1];
    const double p1 = coefficients[2];
    const double p2 = coefficients[3];
    const double x = u.x();
    const double y = u.y();
    const double r2 = u.squaredNorm();
    if (!ProfileRises(std::array{k1, k2}, r2)) return false;

    const double L = 1 + r2 * (k1 + r2 * k2);
    const double L_by_r2 = k1 + 2 * k2 * r2;
    Eigen::Matrix2d J;
    J(0, 0) = L + 2 * L_by_r2 * x * x + 2 * p1 * y + 6 * p2 * x;
    J(1, 1) = L + 2 * L_by_r2 * y * y + 6 * p1 * y + 2 * p2 * x;
    J(0, 1) = 2 * (L_by_r2 * x * y + p1 * x + p2 * y);
    J(1, 0) = J(0, 1);
    if (!(J.trace() > 0 && J.determinant() > 0)) return false;

    d->x() = x * L + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    d->y() = y * L + 2 * p2 * x * y + p1 * (r2 + 2 * y * y);
    if (d_by_u != nullptr) *d_by_u = J;
    if (d_by_coefficients != nullptr) {
      d_by_coefficients->col(0) = r2 * u;
      d_by_coefficients->col(1) = r2 * r2 * u;
      d_by_coefficients->col(2) << 2 * x * y, r2 + 2 * y * y;
      d_by_coefficients->col(3) << r2 + 2 * x * x, 2 * x * y;
    }
    return true;
  }

  // The inverse of Distort. Returns false and sets nothing where there is none.
  static bool Undistort(std::span<const double, kSize> coefficients,
                        const Eigen::Vector2d& d,
                        Eigen::Vector2d* u) {
    constexpr int kMaxIterations = 100;
    constexpr int kMaxHalvings = 30;
    // Newton's method ends at rounding, well below the error that is accepted;
    // a larger one is left over where the region ends before d.
    constexpr double kRounding = 2e-16;
    constexpr double kAccepted = 1e-12;
    const double scale = 1 + d.stableNorm();
    Eigen::Vector2d point = Eigen::Vector2d::Zero();
    Eigen::Vector2d image;
    Eigen::Matrix2d J;
    if (!Distort(coefficients, point, &image, &J, nullptr)) return false;
    double error = (d - image).stableNorm();
    for (int i = 0; i < kMaxIterations && error > kRounding * d.stableNorm();
         ++i) {
      Eigen::Vector2d step = J.inverse() * (d - image);
      bool better = false;
      for (int j = 0; j < kMaxHalvings && !better; ++j, step /= 2) {
        const Eigen::Vector2d candidate = point + step;
        Eigen::Vector2d candidate_image;
        Eigen::Matrix2d candidate_J;
        if (!Distort(coefficients,
                     candidate,
                     &candidate_image,
                     &candidate_J,
                     nullptr)) {
          continue;
        }
        const double candidate_error = (d - candidate_image).stableNorm();
        if (!(candidate_error < error)) continue;
        better = true;
        point = candidate;
        image = candidate_image;
        J = candidate_J;
        error = candidate_error;
      }
      if (!better) break;  // at rounding, or against the edge of the region
    }
    if (!(error <= kAccepted * scale)) return false;
    *u = point;
    return true;
  }
};

}  // namespace selfcal
