// The two functions behind the distortion models that are 0/0 on the axis,
// with their derivatives, to about 1e-13 everywhere.
//
//   g(q) = atan(sqrt(q)) / sqrt(q) = 1 - q/3 + q^2/5 - q^3/7 + ...
//   g'(q) = (1 / (1 + q) - g) / (2 q) = -1/3 + 2q/5 - 3q^2/7 + ...
//   h(x) = tan(x) / x = 1 + x^2/3 + 2x^4/15 + 17x^6/315 + ...
//   h'(x) = (1 + tan^2(x) - h) / x
//
// Written in q = r^2, g is smooth through zero, so that no model divides by a
// radius. The closed forms of the derivatives cancel near zero: they lose
// eps / q and eps / x^2. The series are used below the points where both meet
// at about 1e-13.
#pragma once

#include <cmath>

namespace selfcal {

struct ValueAndDerivative {
  double value;
  double derivative;
};

// g and dg/dq for q >= 0.
inline ValueAndDerivative AtanRatio(double q) {
  if (q < 1e-2) {
    double value = 0;
    double derivative = 0;
    for (int n = 9; n >= 0; --n) {  // Horner's rule, for both at once
      derivative = derivative * q + value;
      value = value * q + (n % 2 == 0 ? 1.0 : -1.0) / (2 * n + 1);
    }
    return {value, derivative};
  }
  const double root = std::sqrt(q);
  const double value = std::atan(root) / root;
  return {value, (1 / (1 + q) - value) / (2 * q)};
}

// h and dh/dx for |x| < pi/2.
inline ValueAndDerivative TanRatio(double x) {
  const double x2 = x * x;
  if (x2 < 2.5e-3) {
    const double value =
        1 + x2 * (1.0 / 3 +
                  x2 * (2.0 / 15 + x2 * (17.0 / 315 + x2 * (62.0 / 2835))));
    const double derivative =
        x * (2.0 / 3 + x2 * (8.0 / 15 +
                             x2 * (34.0 / 105 + x2 * (496.0 / 2835 +
                                                      x2 * (2764.0 / 31185)))));
    return {value, derivative};
  }
  const double tangent = std::tan(x);
  const double value = tangent / x;
  return {value, (1 + tangent * tangent - value) / x};
}

}  // namespace selfcal
