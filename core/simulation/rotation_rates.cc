#include "core/simulation/rotation_rates.h"

#include <Eigen/Geometry>
#include <cmath>

namespace selfcal {
namespace {

// Derivatives, with respect to the square of the angle, of b and c in
//   J_r(phi) = I - b [phi]x + c [phi]x^2,
//   b = (1 - cos t) / t^2, c = (t - sin t) / t^3, t = |phi|:
// b' = (db/dt) / t (phi . phi'), c' likewise.
struct JacobianTerms {
  double b, c;
  double b_slope, c_slope;  // (db/dt) / t, (dc/dt) / t
};

JacobianTerms TermsOf(double t) {
  const double t2 = t * t;
  if (t < 1e-2) {
    // Taylor series; the next terms are below 1e-12.
    return {0.5 - t2 / 24 + t2 * t2 / 720,
            1.0 / 6 - t2 / 120 + t2 * t2 / 5040,
            -1.0 / 12 + t2 / 180 - t2 * t2 / 6720,
            -1.0 / 60 + t2 / 1260 - t2 * t2 / 60480};
  }
  const double s = std::sin(t);
  const double v = 1 - std::cos(t);
  return {v / t2,
          (t - s) / (t2 * t),
          (t * s - 2 * v) / (t2 * t2),
          (t * v - 3 * (t - s)) / (t2 * t2 * t)};
}

}  // namespace

RotationRates RatesOf(const Curve& phi) {
  const Eigen::Vector3d x = phi.x;
  const Eigen::Vector3d d1 = phi.d1;
  const Eigen::Vector3d d2 = phi.d2;
  const JacobianTerms j = TermsOf(x.norm());
  const double slope = x.dot(d1);
  const Eigen::Vector3d first = x.cross(d1);
  const Eigen::Vector3d second = x.cross(first);
  const Eigen::Vector3d first_d = x.cross(d2);
  const Eigen::Vector3d second_d = d1.cross(first) + x.cross(first_d);
  return {d1 - j.b * first + j.c * second,
          d2 - j.b_slope * slope * first - j.b * first_d +
              j.c_slope * slope * second + j.c * second_d};
}

}  // namespace selfcal
