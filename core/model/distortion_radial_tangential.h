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
// tangential terms its eigenvalues are L and the slope of the radial profile, 1
// + 3 k1 r^2 + 5 k2 r^4, and the region is the disc up to the first zero of the
// slope. The tangential terms of a real lens move its boundary only slightly. A
// point is therefore valid if the profile increases from the axis to the point
// and dd/du is positive definite at the point.
//
// The inverse has no closed form. It is Newton's method on d(u) = d, started on
// the axis, with steps halved until they stay in the region and reduce the
// error. The error decreases at every step, so the iteration terminates; for a
// d without an inverse it does so at the boundary of the region.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/monotonic.h"

namespace selfcal {

class DistortionRadialTangential {
  static constexpr Interval kValid = {-1e3, 1e3};
  static constexpr Interval kTangential = {-2e-3, 2e-3};

 public:
  static constexpr std::string_view kName = "radial-tangential";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "k1", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.4, 0.2}},
      {.name = "k2", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.1}},
      {.name = "p1", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential},
      {.name = "p2", .sigma_ref = 5e-4, .valid = kValid, .usual = kTangential}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr", .name = "pinhole", .distortion = "radtan"},
      {.tool = "openvins", .name = "pinhole", .distortion = "radtan"},
      {.tool = "orb_slam3",
       .name = "PinHole",
       .coefficients = "k1 k2 p1 p2",
       .zeros = "k3"},
      {.tool = "vins_fusion",
       .name = "PINHOLE",
       .coefficients = "distortion_parameters.k1 distortion_parameters.k2 "
                       "distortion_parameters.p1 distortion_parameters.p2",
       .pixels = "projection_parameters.fx projection_parameters.fy "
                 "projection_parameters.cx projection_parameters.cy"},
      {.tool = "basalt",
       .name = "pinhole-radtan8",
       .coefficients = "k1 k2 p1 p2",
       .zeros = "k3 k4 k5 k6"},
      {.tool = "maplab", .name = "pinhole", .distortion = "radial-tangential"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit DistortionRadialTangential(
      std::span<const double, kSize> coefficients)
      : radial_{coefficients[0], coefficients[1]},
        p1_(coefficients[2]),
        p2_(coefficients[3]) {}

  // Computes d = distort(u), and its derivatives with respect to u and (k1, k2,
  // p1, p2) unless these are null. Returns false where the model is not
  // one-to-one; the outputs are then meaningless. T is double or Lanes.
  template <typename T>
  auto Distort(const Eigen::Matrix<T, 2, 1>& u,
               Eigen::Matrix<T, 2, 1>* d,
               Eigen::Matrix<T, 2, 2>* d_by_u,
               Eigen::Matrix<T, 2, kSize>* d_by_coefficients) const {
    const double k1 = radial_[0], k2 = radial_[1];
    const T x = u[0], y = u[1];
    const T r2 = x * x + y * y;
    const T L = 1.0 + r2 * (k1 + r2 * k2);
    const T twice_L_by_r2 = 2 * k1 + 4 * k2 * r2;
    Eigen::Matrix<T, 2, 2> J;
    J(0, 0) = L + twice_L_by_r2 * x * x + 2 * p1_ * y + 6 * p2_ * x;
    J(1, 1) = L + twice_L_by_r2 * y * y + 6 * p1_ * y + 2 * p2_ * x;
    J(0, 1) = twice_L_by_r2 * x * y + 2 * p1_ * x + 2 * p2_ * y;
    J(1, 0) = J(0, 1);

    (*d)[0] = x * L + 2 * p1_ * x * y + p2_ * (r2 + 2.0 * x * x);
    (*d)[1] = y * L + 2 * p2_ * x * y + p1_ * (r2 + 2.0 * y * y);
    if (d_by_u != nullptr) *d_by_u = J;
    if (d_by_coefficients != nullptr) {
      const T xy = 2.0 * x * y;
      *d_by_coefficients << r2 * x, r2 * r2 * x, xy, r2 + 2.0 * x * x, r2 * y,
          r2 * r2 * y, r2 + 2.0 * y * y, xy;
    }
    return ProfileRises(radial_, r2) && J(0, 0) + J(1, 1) > T(0) &&
           J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0) > T(0);
  }

  // Inverse of Distort. Returns false and sets nothing where there is none.
  bool Undistort(const Eigen::Vector2d& d, Eigen::Vector2d* u) const {
    constexpr int kMaxIterations = 100;
    constexpr int kMaxHalvings = 30;
    // Newton's method converges to rounding error, well below the accepted
    // error; a larger error remains where the region ends before d.
    constexpr double kRounding = 2e-16;
    constexpr double kAccepted = 1e-12;
    const double scale = 1 + d.stableNorm();
    Eigen::Vector2d point = Eigen::Vector2d::Zero();
    Eigen::Vector2d image;
    Eigen::Matrix2d J;
    if (!Distort<double>(point, &image, &J, nullptr)) return false;
    double error = (d - image).stableNorm();
    for (int i = 0; i < kMaxIterations && error > kRounding * d.stableNorm();
         ++i) {
      Eigen::Vector2d step = J.inverse() * (d - image);
      bool better = false;
      for (int j = 0; j < kMaxHalvings && !better; ++j, step /= 2) {
        const Eigen::Vector2d candidate = point + step;
        Eigen::Vector2d candidate_image;
        Eigen::Matrix2d candidate_J;
        if (!Distort<double>(
                candidate, &candidate_image, &candidate_J, nullptr)) {
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
      if (!better)
        break;  // at rounding error, or at the boundary of the region
    }
    if (!(error <= kAccepted * scale)) return false;
    *u = point;
    return true;
  }

 private:
  std::array<double, 2> radial_;
  double p1_, p2_;
};

}  // namespace selfcal
