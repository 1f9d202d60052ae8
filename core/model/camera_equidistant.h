// The equidistant fish-eye model of Kannala and Brandt, "A generic camera model
// and calibration method for conventional, wide-angle, and fish-eye lenses"
// (2006), with k1 .. k4. theta is the angle between the ray p_C = (X, Y, Z) and
// the axis, r = sqrt(X^2 + Y^2):
//
//   theta = atan2(r, Z),  theta_d = theta P(theta^2),
//   P(Q) = 1 + k1 Q + k2 Q^2 + k3 Q^3 + k4 Q^4,   d = (theta_d / r) (X, Y).
//
// Half the angle, theta = 2 atan(r / w) with w = Z + |p_C|, leaves no division
// by r, and no cases. With v = (X, Y) / w, q = |v|^2 and
// g(q) = atan(sqrt(q)) / sqrt(q), so that theta^2 = 4 q g^2,
//
//   d = s v,   s = 2 g(q) P(Q),   Q = 4 q g(q)^2.
//
// Derivatives, with dQ/dq = 4 g / (1 + q) and h = 2 / (1 + q) = w / |p_C|:
//
//   ds/dq  = 2 g'(q) P(Q) + 8 g^2 P'(Q) / (1 + q)
//   dd/dv  = M = s I + 2 ds/dq v v^T
//   dd/dp  = ( [M 0] - h M v (v_x, v_y, 1) ) / w
//   dd/dk_i = 2 g Q^i v
//
// Beyond 90 degrees w = r^2 / (|p_C| - Z), which has no cancellation.
//
// The model is one-to-one as long as theta_d increases, up to the first zero of
// 1 + 3 k1 Q + 5 k2 Q^2 + 7 k3 Q^3 + 9 k4 Q^4, and to an angle of
// 2 atan(2000), 0.001 rad short of 180 degrees, where all directions meet. The
// inverse solves theta_d(theta) = |d| by Newton's method inside a bracket of
// the angles, with bisection when a step leaves the bracket; the ray is
// (sin(theta) d / |d|, cos(theta)).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <string_view>

#include "core/model/axial_camera.h"
#include "core/model/camera_model.h"
#include "core/model/distortion_series.h"
#include "core/model/monotonic.h"
#include "core/simd/lanes.h"

namespace selfcal {

class CameraEquidistant {
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
      {.tool = "maplab", .name = "pinhole", .distortion = "equidistant"},
      {.tool = "camera_info", .name = "equidistant"}};
  static constexpr int kSize = std::size(kCoefficients);

  explicit CameraEquidistant(std::span<const double, kSize> k)
      : k_{k[0], k[1], k[2], k[3]} {}

  template <typename T>
  auto Project(const PixelMap& pixels,
               const Eigen::Matrix<T, 3, 1>& p_C,
               Eigen::Matrix<T, 2, 1>* z_px,
               ProjectionParts<T, kSize>* parts) const {
    const T Z = p_C[2];
    const T r2 = p_C[0] * p_C[0] + p_C[1] * p_C[1];
    const T square = r2 + Z * Z;
    const auto usable = UsableSquare(square);
    const T length = Sqrt(Select(usable, square, T(1)));
    T w = length + Z;
    const auto behind = Z < T(0);
    if (Any(behind)) w = Select(behind, r2 / (length - Z), w);
    // The comparison is false for NaN, and for w = 0.
    const auto seen = usable && r2 < kMaxHalfTangent * kMaxHalfTangent * w * w;
    const T inverse = 1.0 / Select(seen, w, T(1));
    const Eigen::Matrix<T, 2, 1> v(Select(seen, inverse * p_C[0], T(0)),
                                   Select(seen, inverse * p_C[1], T(0)));
    const T q = v[0] * v[0] + v[1] * v[1];
    const ValueAndDerivative<T> g = AtanRatio(q);
    const T Q = 4.0 * q * g.value * g.value;
    const T P = 1.0 + Q * (k_[0] + Q * (k_[1] + Q * (k_[2] + Q * k_[3])));
    const T s = 2.0 * g.value * P;
    const Eigen::Matrix<T, 2, 1> d(s * v[0], s * v[1]);
    if (parts != nullptr) {
      const T h = 2.0 / (1.0 + q);
      const T P_by_Q =
          k_[0] + Q * (2 * k_[1] + Q * (3 * k_[2] + Q * (4 * k_[3])));
      const T twice_s_by_q =
          4.0 * (g.derivative * P + 2.0 * g.value * g.value * P_by_Q * h);
      const T radial = s + twice_s_by_q * q;  // M v = radial v
      for (int i = 0; i < 2; ++i) {
        const T by_length = h * radial * v[i];
        for (int j = 0; j < 2; ++j) {
          const T M = twice_s_by_q * v[i] * v[j] + (i == j ? s : T(0));
          parts->point(i, j) = inverse * (M - by_length * v[j]);
        }
        parts->point(i, 2) = -inverse * by_length;
        T column = 2.0 * g.value * v[i];
        for (int j = 0; j < kSize; ++j) {
          column *= Q;
          parts->distortion(i, j) = column;
        }
      }
    }
    ToPixel<T, kSize>(pixels, d, z_px, parts);
    return seen && ProfileRises(k_, Q);
  }

  bool Unproject(const Eigen::Vector2d& d, Eigen::Vector3d* ray_C) const {
    const double theta_d = d.stableNorm();
    double theta;
    if (!SolveAngle(theta_d, &theta)) return false;
    // The ratio of the two radii is 1 on the axis; computed, it would be 0/0.
    const double ratio = theta_d > 0 ? std::sin(theta) / theta_d : 1;
    *ray_C << ratio * d, std::cos(theta);
    return true;
  }

 private:
  // Largest tangent of half the angle.
  static constexpr double kMaxHalfTangent = 2000;

  // Finds the angle theta with theta_d(theta) = theta_d, where theta_d
  // increases.
  bool SolveAngle(double theta_d, double* theta) const {
    const std::array<double, 4>& k = k_;
    constexpr int kMaxIterations = 100;
    // The iteration converges to rounding error, well below the accepted error;
    // a larger error remains where the profile ends below theta_d.
    constexpr double kAccepted = 1e-12;
    double low = 0;
    double high = 2 * std::atan(kMaxHalfTangent);
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
