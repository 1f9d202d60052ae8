// The functions of so3.h as templates over the scalar, for one rotation or
// several at once. Internal to core/model and core/factor.
//
// Up to kSeriesAngle the series are exact to rounding. Beyond it, which is far
// more than an inertial sensor rotates between two samples, each lane uses the
// closed forms, which lose no accuracy there.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "core/model/distortion_series.h"
#include "core/model/so3.h"
#include "core/simd/lanes.h"

namespace selfcal {

// [rad]. The first truncated term of each series is 1e-17 there.
constexpr double kSeriesAngle = 0.5;

// c0 + c1 x + c2 x^2 + ...
template <typename T>
T Polynomial(T, double c) {
  return T(c);
}
template <typename T, typename... Rest>
T Polynomial(T x, double c, Rest... rest) {
  return c + x * Polynomial(x, rest...);
}

// Returns the value of the series, or the closed form where angle2 is beyond
// it.
template <typename T, typename Function>
T BeyondSeries(T angle2, T series, Function closed_form) {
  const auto beyond = angle2 > T(kSeriesAngle * kSeriesAngle);
  if (!Any(beyond)) return series;
  return Select(beyond, ForEachLane(angle2, closed_form), series);
}

template <typename T>
Eigen::Matrix<T, 3, 3> Skew(const Eigen::Matrix<T, 3, 1>& v) {
  const T zero(0);
  Eigen::Matrix<T, 3, 3> m;
  m << zero, -v.z(), v.y(), v.z(), zero, -v.x(), -v.y(), v.x(), zero;
  return m;
}

template <typename T>
Eigen::Quaternion<T> Exp(const Eigen::Matrix<T, 3, 1>& phi) {
  const T angle2 = phi.squaredNorm();
  const T x = -0.25 * angle2;
  const T cosine =
      BeyondSeries(angle2,
                   Polynomial(x,
                              1,
                              1.0 / 2,
                              1.0 / 24,
                              1.0 / 720,
                              1.0 / 40320,
                              1.0 / 3628800,
                              1.0 / 479001600),
                   [](double a2) { return std::cos(std::sqrt(a2) / 2); });
  // sin(angle / 2) / angle
  const T sine_by_angle = BeyondSeries(
      angle2,
      Polynomial(x,
                 1.0 / 2,
                 1.0 / 12,
                 1.0 / 240,
                 1.0 / 10080,
                 1.0 / 725760,
                 1.0 / 79833600),
      [](double a2) { return std::sin(std::sqrt(a2) / 2) / std::sqrt(a2); });
  Eigen::Quaternion<T> q;
  q.w() = cosine;
  q.vec() = sine_by_angle * phi;
  return q;
}

// Both signs of q are equally short for a rotation by exactly pi; the result is
// the one whose first nonzero component is positive.
template <typename T>
Eigen::Matrix<T, 3, 1> Log(const Eigen::Quaternion<T>& q) {
  const T zero(0);
  const Eigen::Matrix<T, 3, 1> v = q.vec();
  const auto begins_negative =
      v[0] < zero ||
      (!(v[0] > zero) && (v[1] < zero || (!(v[1] > zero) && v[2] < zero)));
  const auto flip = q.w() < zero || (!(q.w() > zero) && begins_negative);
  // The arc tangent is accurate at both ends; the arc sine would lose half of
  // the digits near pi, the arc cosine near zero. At pi, w is zero.
  const T w = Max(Abs(q.w()), T(1e-150));
  const T factor = 2.0 * AtanRatioValue(v.squaredNorm() / (w * w)) / w;
  return Select(flip, -factor, factor) * v;
}

// Coefficients of rotations by phi and of their derivatives.
template <typename T>
struct RotationTerms {
  T a;  // (1 - cos) / angle^2
  T b;  // (angle - sin) / angle^3
};

template <typename T>
RotationTerms<T> RotationTermsOf(T angle2) {
  const T a = BeyondSeries(angle2,
                           Polynomial(-angle2,
                                      1.0 / 2,
                                      1.0 / 24,
                                      1.0 / 720,
                                      1.0 / 40320,
                                      1.0 / 3628800,
                                      1.0 / 479001600,
                                      1.0 / 87178291200),
                           [](double a2) {
                             const double s = std::sin(std::sqrt(a2) / 2);
                             return 2 * s * s / a2;
                           });
  const T b = BeyondSeries(angle2,
                           Polynomial(-angle2,
                                      1.0 / 6,
                                      1.0 / 120,
                                      1.0 / 5040,
                                      1.0 / 362880,
                                      1.0 / 39916800,
                                      1.0 / 6227020800,
                                      1.0 / 1307674368000),
                           [](double a2) {
                             const double angle = std::sqrt(a2);
                             return (angle - std::sin(angle)) / (a2 * angle);
                           });
  return {a, b};
}

// scale I + linear [phi]x + square phi phi^T.
template <typename T>
Eigen::Matrix<T, 3, 3> SkewPolynomial(T scale,
                                      T linear,
                                      T square,
                                      const Eigen::Matrix<T, 3, 1>& phi) {
  const Eigen::Matrix<T, 3, 1> l = linear * phi;
  const Eigen::Matrix<T, 3, 1> s = square * phi;
  const T xy = s[0] * phi[1], xz = s[0] * phi[2], yz = s[1] * phi[2];
  Eigen::Matrix<T, 3, 3> m;
  m << scale + s[0] * phi[0], xy - l[2], xz + l[1],  //
      xy + l[2], scale + s[1] * phi[1], yz - l[0],   //
      xz - l[1], yz + l[0], scale + s[2] * phi[2];
  return m;
}

// J_r(phi) = I - a [phi]x + b [phi]x^2.
template <typename T>
Eigen::Matrix<T, 3, 3> RightJacobian(const Eigen::Matrix<T, 3, 1>& phi) {
  const T angle2 = phi.squaredNorm();
  const RotationTerms<T> terms = RotationTermsOf(angle2);
  return SkewPolynomial<T>(1.0 - terms.b * angle2, -terms.a, terms.b, phi);
}

template <typename T>
Eigen::Matrix<T, 3, 3> RightJacobianInverse(const Eigen::Matrix<T, 3, 1>& phi) {
  const T angle2 = phi.squaredNorm();
  // (1 - angle / 2 cot(angle / 2)) / angle^2; in terms of the half angle it has
  // no singularity below 2 pi.
  const T c =
      BeyondSeries(angle2,
                   Polynomial(angle2,
                              1.0 / 12,
                              1.0 / 720,
                              1.0 / 30240,
                              1.0 / 1209600,
                              1.0 / 47900160,
                              691.0 / 1307674368000,
                              1.0 / 74724249600),
                   [](double a2) {
                     const double half = std::sqrt(a2) / 2;
                     return (1 - half * std::cos(half) / std::sin(half)) / a2;
                   });
  return SkewPolynomial<T>(1.0 - c * angle2, T(0.5), c, phi);
}

}  // namespace selfcal
