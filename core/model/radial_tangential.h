// Distortions with a radial factor L(r^2) and two tangential coefficients, p1
// and p2, of the plane u = (x, y), r^2 = x^2 + y^2 (Brown, "Close-range camera
// calibration", 1971):
//
//   d_x = x L + 2 p1 x y + p2 (r^2 + 2 x^2)
//   d_y = y L + 2 p2 x y + p1 (r^2 + 2 y^2)
//
// Derivatives, with L' = dL/d(r^2):
//
//   dd/du = L I + 2 L' u u^T + [ 2 p1 y + 6 p2 x   2 p1 x + 2 p2 y ]
//                              [ 2 p1 x + 2 p2 y   6 p1 y + 2 p2 x ]
//   dd/dk = dL/dk u,   dd/dp = ( (2 x y, r^2 + 2 y^2),  (r^2 + 2 x^2, 2 x y) )
//
// dd/du is symmetric: d is the gradient of a potential, and the model is
// one-to-one on a convex region in which dd/du is positive definite. Without
// tangential terms its eigenvalues are L and the slope of the radial profile,
// L + 2 r^2 L', and the region is the disc up to the first zero of the slope.
// The tangential terms of a real lens move its boundary only slightly. A point
// is therefore valid if the profile increases from the axis to the point and
// dd/du is positive definite at the point.
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
#include <cstddef>
#include <span>

#include "core/model/monotonic.h"

namespace selfcal {

// L and its derivatives with respect to r^2 and to its N coefficients.
template <typename T, int N>
struct RadialFactor {
  T value;
  T derivative;
  std::array<T, N> by_coefficients;
};

// L = 1 + k1 r^2 + .. + kN r^(2N).
template <int N>
class RadialPolynomial {
 public:
  static constexpr int kSize = N;

  explicit RadialPolynomial(const std::array<double, N>& k) : k_(k) {}

  template <typename T>
  RadialFactor<T, N> At(T r2) const {
    RadialFactor<T, N> L;
    L.value = k_[N - 1];
    L.derivative = N * k_[N - 1];
    for (int i = N - 1; i > 0; --i) {
      L.value = k_[i - 1] + r2 * L.value;
      L.derivative = i * k_[i - 1] + r2 * L.derivative;
    }
    L.value = 1.0 + r2 * L.value;
    T power = r2;
    for (T& by_k : L.by_coefficients) {
      by_k = power;
      power *= r2;
    }
    return L;
  }

  // True if r L increases on [0, r].
  template <typename T>
  auto Rises(T r2) const {
    return ProfileRises(k_, r2);
  }

 private:
  std::array<double, N> k_;
};

// The rational factor of OpenCV, with k1 .. k6:
//
//   L = A / B,   A = 1 + k1 q + k2 q^2 + k3 q^3,
//                B = 1 + k4 q + k5 q^2 + k6 q^3,   q = r^2,
//   L' = (A' - L B') / B,   dL/dk1 .. k3 = q^i / B,   dL/dk4 .. k6 = -L q^i /
//   B.
//
// The slope of the profile, L + 2 q L', has the sign of a polynomial of degree
// 6 as long as B has no zero: A B + 2 q (A' B - A B').
class RadialRational {
 public:
  static constexpr int kSize = 6;

  explicit RadialRational(const std::array<double, kSize>& k)
      : numerator_{1, k[0], k[1], k[2]},
        denominator_{1, k[3], k[4], k[5]},
        slope_{} {
    for (int i = 0; i <= 3; ++i) {
      for (int j = i == 0 ? 1 : 0; j <= 3; ++j) {
        slope_[i + j - 1] +=
            (1 + 2 * (i - j)) * numerator_[i] * denominator_[j];
      }
    }
  }

  template <typename T>
  RadialFactor<T, kSize> At(T q) const {
    const T inverse = 1.0 / Value(denominator_, q);
    RadialFactor<T, kSize> L;
    L.value = Value(numerator_, q) * inverse;
    L.derivative =
        (Slope(numerator_, q) - L.value * Slope(denominator_, q)) * inverse;
    T power = inverse;
    for (int i = 0; i < 3; ++i) {
      power *= q;
      L.by_coefficients[i] = power;
      L.by_coefficients[3 + i] = -L.value * power;
    }
    return L;
  }

  // True if r L increases on [0, r], and has no pole there.
  template <typename T>
  auto Rises(T q) const {
    return PositiveUpTo(
               std::array{denominator_[1], denominator_[2], denominator_[3]},
               q) &&
           PositiveUpTo(slope_, q);
  }

 private:
  using Cubic = std::array<double, 4>;

  template <typename T>
  static T Value(const Cubic& a, T q) {
    return a[0] + q * (a[1] + q * (a[2] + q * a[3]));
  }
  template <typename T>
  static T Slope(const Cubic& a, T q) {
    return a[1] + q * (2 * a[2] + q * (3 * a[3]));
  }

  Cubic numerator_;
  Cubic denominator_;
  std::array<double, 6> slope_;  // coefficients of q .. q^6, after the 1
};

// The coefficients are in OpenCV's order: k1 k2 p1 p2 k3 ...
template <class Radial>
class RadialTangential {
 public:
  static constexpr int kSize = Radial::kSize + 2;

  explicit RadialTangential(std::span<const double, kSize> coefficients)
      : radial_(RadialOf(coefficients)),
        p1_(coefficients[kP1]),
        p2_(coefficients[kP2]) {}

  // Computes d = distort(u), and its derivatives with respect to u and the
  // coefficients unless these are null. Returns false where the model is not
  // one-to-one; the outputs are then meaningless. T is double or Lanes.
  template <typename T>
  auto Distort(const Eigen::Matrix<T, 2, 1>& u,
               Eigen::Matrix<T, 2, 1>* d,
               Eigen::Matrix<T, 2, 2>* d_by_u,
               Eigen::Matrix<T, 2, kSize>* d_by_coefficients) const {
    const T x = u[0], y = u[1];
    const T r2 = x * x + y * y;
    const RadialFactor<T, Radial::kSize> factor = radial_.template At<T>(r2);
    const T L = factor.value;
    const T twice_L_by_r2 = 2.0 * factor.derivative;
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
      d_by_coefficients->col(kP1) << xy, r2 + 2.0 * y * y;
      d_by_coefficients->col(kP2) << r2 + 2.0 * x * x, xy;
      for (int i = 0; i < Radial::kSize; ++i) {
        d_by_coefficients->col(i < kP1 ? i : i + 2) =
            factor.by_coefficients[i] * u;
      }
    }
    return radial_.template Rises<T>(r2) && J(0, 0) + J(1, 1) > T(0) &&
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
  static constexpr int kP1 = 2;
  static constexpr int kP2 = 3;

  static Radial RadialOf(std::span<const double, kSize> coefficients) {
    std::array<double, Radial::kSize> k;
    for (int i = 0; i < Radial::kSize; ++i) {
      k[i] = coefficients[i < kP1 ? i : i + 2];
    }
    return Radial(k);
  }

  Radial radial_;
  double p1_, p2_;
};

}  // namespace selfcal
