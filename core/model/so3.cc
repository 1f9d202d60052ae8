#include "core/model/so3.h"

#include <cmath>

namespace selfcal {
namespace {

// Below this angle [rad] the first terms of a series are exact to rounding (the
// next one counts 1e-16 or less), and above it the closed forms lose nothing.
constexpr double kSeriesAngle = 1e-2;

// At a rotation by exactly pi both signs of q are equally short: take the one
// whose first component other than zero is positive.
bool BeginsNegative(const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) {
    if (v[i] != 0) return v[i] < 0;
  }
  return false;
}

}  // namespace

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond Exp(const Eigen::Vector3d& phi) {
  const double angle2 = phi.squaredNorm();
  double cosine;
  double sine_by_angle;  // sin(angle / 2) / angle
  if (angle2 < kSeriesAngle * kSeriesAngle) {
    cosine = 1 - angle2 / 8 * (1 - angle2 / 48);
    sine_by_angle = 0.5 - angle2 / 48 * (1 - angle2 / 80);
  } else {
    const double angle = std::sqrt(angle2);
    cosine = std::cos(angle / 2);
    sine_by_angle = std::sin(angle / 2) / angle;
  }
  Eigen::Quaterniond q;
  q.w() = cosine;
  q.vec() = sine_by_angle * phi;
  return q;
}

Eigen::Vector3d Log(const Eigen::Quaterniond& q) {
  const bool flip = q.w() < 0 || (q.w() == 0 && BeginsNegative(q.vec()));
  const double w = flip ? -q.w() : q.w();
  const Eigen::Vector3d v = flip ? Eigen::Vector3d(-q.vec()) : q.vec();
  const double n = v.norm();
  // atan2 is precise at both ends: the arc sine would lose half of the digits
  // near pi, the arc cosine near zero.
  if (n > kSeriesAngle * w) return 2 * std::atan2(n, w) / n * v;
  const double t2 = n * n / (w * w);  // tan^2(angle / 2)
  return 2 / w * (1 - t2 * (1.0 / 3 - t2 * (1.0 / 5 - t2 / 7))) * v;
}

Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& phi) {
  const double angle2 = phi.squaredNorm();
  double a;  // (1 - cos) / angle^2
  double b;  // (angle - sin) / angle^3
  if (angle2 < kSeriesAngle * kSeriesAngle) {
    a = 0.5 - angle2 / 24 * (1 - angle2 / 30);
    b = 1.0 / 6 - angle2 / 120 * (1 - angle2 / 42);
  } else {
    const double angle = std::sqrt(angle2);
    const double half_sine = std::sin(angle / 2);
    a = 2 * half_sine * half_sine / angle2;
    b = (angle - std::sin(angle)) / (angle2 * angle);
  }
  const Eigen::Matrix3d S = Skew(phi);
  return Eigen::Matrix3d::Identity() - a * S + b * S * S;
}

Eigen::Matrix3d RightJacobianInverse(const Eigen::Vector3d& phi) {
  const double angle2 = phi.squaredNorm();
  double c;  // (1 - angle / 2 cot(angle / 2)) / angle^2
  if (angle2 < kSeriesAngle * kSeriesAngle) {
    c = 1.0 / 12 + angle2 / 720 * (1 + angle2 / 42);
  } else {
    // With the half angle nothing is singular before 2 pi.
    const double half = std::sqrt(angle2) / 2;
    c = (1 - half * std::cos(half) / std::sin(half)) / angle2;
  }
  const Eigen::Matrix3d S = Skew(phi);
  return Eigen::Matrix3d::Identity() + 0.5 * S + c * S * S;
}

}  // namespace selfcal
