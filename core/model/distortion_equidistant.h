// The equidistant fish-eye model of Kannala and Brandt, "A generic camera model
// and calibration method for conventional, wide-angle, and fish-eye lenses"
// (2006), with k1 .. k4. theta is the angle between the ray and the axis:
//
//   theta = atan(r_u),  theta_d = theta P(theta^2),
//   P(Q) = 1 + k1 Q + k2 Q^2 + k3 Q^3 + k4 Q^4,   d = (theta_d / r_u) u.
//
// With q = r_u^2 and g(q) = atan(sqrt(q)) / sqrt(q), so that theta^2 = q g^2,
// the model needs no division by the radius:
//
//   d = s u,   s = g(q) P(Q),   Q = q g(q)^2.
//
// Derivatives, with dQ/dq = g / (1 + q):
//
//   ds/dq  = g'(q) P(Q) + g P'(Q) g / (1 + q)
//   dd/du  = s I + 2 ds/dq u u^T
//   dd/dk_i = g Q^i u
//
// The model is one-to-one as long as theta_d increases, up to the first zero of
// 1 + 3 k1 Q + 5 k2 Q^2 + 7 k3 Q^3 + 9 k4 Q^4. The inverse solves
// theta_d(theta) = |d| by Newton's method inside a bracket of [0, pi/2], with
// bisection when a step leaves the bracket; then u = tan(theta) d / |d|.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>
#include <string_view>

#include "core/model/camera_model.h"
#include "core/model/distortion_series.h"
#include "core/model/monotonic.h"

namespace selfcal {

class DistortionEquidistant {
  static constexpr Interval kValid = {-1e3, 1e3};

 public:
  static constexpr std::string_view kName = "equidistant";
  // sigma_ref is chosen, not measured: the value that moves a point at the edge
  // of a typical image by about 1.5 px. These sigmas shift every entropy of a
  // group by one constant and do not affect the ranking.
  static constexpr CameraCoefficient kCoefficients[] = {
      {.name = "k1", .sigma_ref = 5e-3, .valid = kValid, .usual = {-0.1, 0.1}},
      {.name = "k2",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.05, 0.05}},
      {.name = "k3",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.05, 0.05}},
      {.name = "k4",
       .sigma_ref = 5e-3,
       .valid = kValid,
       .usual = {-0.01, 0.01}}};
  static constexpr ToolModel kTools[] = {
      {.tool = "kalibr", .name = "pinhole", .distortion = "equidistant"},
      {.tool = "openvins", .name = "pinhole", .distortion = "equidistant"},
      {.tool = "orb_slam3",
       .name = "KannalaBrandt8",
       .coefficients = "k1 k2 k3 k4"},
      {.tool = "vins_fusion",
       .name = "KANNALA_BRANDT",
       .coefficients = "projection_parameters.k2 projection_parameters.k3 "
                       "projection_parameters.k4 projection_parameters.k5",
       .pixels = "projection_parameters.mu projection_parameters.mv "
                 "projection_parameters.u0 projection_parameters.v0"},
      {.tool = "basalt", .name = "kb4", .coefficients = "k1 k2 k3 k4"},
      {.tool = "maplab", .name = "pinhole", .distortion = "equidistant"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit DistortionEquidistant(std::span<const double, kSize> k)
      : k_{k[0], k[1], k[2], k[3]} {}

  // Computes d = distort(u), and its derivatives with respect to u and (k1 ..
  // k4) unless these are null. Returns false where the model is not one-to-one;
  // the outputs are then meaningless. T is double or Lanes.
  template <typename T>
  auto Distort(const Eigen::Matrix<T, 2, 1>& u,
               Eigen::Matrix<T, 2, 1>* d,
               Eigen::Matrix<T, 2, 2>* d_by_u,
               Eigen::Matrix<T, 2, kSize>* d_by_coefficients) const {
    const T q = u[0] * u[0] + u[1] * u[1];
    const ValueAndDerivative<T> g = AtanRatio(q);
    const T Q = q * g.value * g.value;
    const T P = 1.0 + Q * (k_[0] + Q * (k_[1] + Q * (k_[2] + Q * k_[3])));
    const T s = g.value * P;
    *d = s * u;
    if (d_by_u != nullptr) {
      const T P_by_Q =
          k_[0] + Q * (2 * k_[1] + Q * (3 * k_[2] + Q * (4 * k_[3])));
      const T twice_s_by_q =
          2.0 * (g.derivative * P + g.value * P_by_Q * g.value / (1.0 + q));
      const T off_diagonal = twice_s_by_q * u[0] * u[1];
      *d_by_u << s + twice_s_by_q * u[0] * u[0], off_diagonal, off_diagonal,
          s + twice_s_by_q * u[1] * u[1];
    }
    if (d_by_coefficients != nullptr) {
      Eigen::Matrix<T, 2, 1> column = g.value * u;
      for (int i = 0; i < kSize; ++i) {
        column *= Q;
        d_by_coefficients->col(i) = column;
      }
    }
    return ProfileRises(k_, Q);
  }

  // Inverse of Distort. Returns false and sets nothing where there is none.
  bool Undistort(const Eigen::Vector2d& d, Eigen::Vector2d* u) const {
    const double theta_d = d.stableNorm();
    double theta;
    if (!SolveAngle(theta_d, &theta)) return false;
    // The ratio of the two radii is 1 on the axis; computed, it would be 0/0.
    *u = theta_d > 0 ? Eigen::Vector2d(std::tan(theta) * (d / theta_d)) : d;
    return true;
  }

 private:
  // Finds theta in [0, pi/2] with theta_d(theta) = theta_d, where theta_d
  // increases.
  bool SolveAngle(double theta_d, double* theta) const {
    const std::array<double, 4>& k = k_;
    constexpr int kMaxIterations = 100;
    // The iteration converges to rounding error, well below the accepted error;
    // a larger error remains where the profile ends below theta_d.
    constexpr double kAccepted = 1e-12;
    double low = 0;
    double high = std::numbers::pi / 2;
    double x = std::min(theta_d, high);
    for (int i = 0; i < kMaxIterations; ++i) {
      const double Q = x * x;
      const bool rises = ProfileRises(k, Q);
      const double P = 1 + Q * (k[0] + Q * (k[1] + Q * (k[2] + Q * k[3])));
      const double error = theta_d - x * P;
      (rises && error > 0 ? low : high) = x;
      const double slope =
          1 + Q * (3 * k[0] + Q * (5 * k[1] + Q * (7 * k[2] + Q * 9 * k[3])));
      const double newton = x + error / slope;
      const bool inside = rises && newton > low && newton < high;
      const double next = inside ? newton : low + (high - low) / 2;
      const bool ended = (rises && newton == x) || next == low || next == high;
      if (ended || i + 1 == kMaxIterations) {
        *theta = x;
        return rises && std::abs(error) <= kAccepted * theta_d;
      }
      x = next;
    }
    return false;
  }

  std::array<double, 4> k_;
};

}  // namespace selfcal
