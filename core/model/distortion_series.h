// The two functions of the distortion models that are 0/0 on the axis, with
// their derivatives, accurate to about 1e-13 everywhere.
//
//   g(q) = atan(sqrt(q)) / sqrt(q) = 1 - q/3 + q^2/5 - q^3/7 + ...
//   g'(q) = (1 / (1 + q) - g) / (2 q) = -1/3 + 2q/5 - 3q^2/7 + ...
//   h(x) = tan(x) / x = 1 + x^2/3 + 2x^4/15 + 17x^6/315 + ...
//   h'(x) = (1 + tan^2(x) - h) / x
//
// As a function of q = r^2, g is smooth at zero, so that no model divides by a
// radius. The vectorised form halves the angle twice,
// atan(x) = 2 atan(x / (1 + s)) with s = sqrt(1 + x^2), after which the series
// is short for every q; in terms of squares,
//
//   q -> (s - 1) / (s + 1),   g(q) = 2 / (1 + s) g((s - 1) / (s + 1)).
//
// The closed forms of the derivatives suffer from cancellation near zero: they
// lose eps / q and eps / x^2. Series are used below the points where both
// errors are about 1e-13.
#pragma once

#include <cmath>

#include "core/simd/lanes.h"

namespace selfcal {

template <typename T>
struct ValueAndDerivative {
  T value;
  T derivative;
};

// g for q >= 0, accurate to rounding error.
inline double AtanRatioValue(double q) {
  if (q < 1e-2) {
    double value = 0;
    for (int n = 9; n >= 0; --n) value = 1.0 / (2 * n + 1) - value * q;
    return value;
  }
  const double root = std::sqrt(q);
  return std::atan(root) / root;
}

// Vectorised g, accurate to a few rounding errors; Eigen has no vectorised arc
// tangent.
template <int W>
Lanes<W> AtanRatioValue(Lanes<W> q) {
  Lanes<W> halved = q;  // below tan^2(pi / 8) = 0.172 in the end
  Lanes<W> factor = 4.0;
  for (int i = 0; i < 2; ++i) {
    const Lanes<W> s = Sqrt(1.0 + halved);
    const Lanes<W> inverse = 1.0 / (1.0 + s);
    factor *= inverse;
    halved = (s - 1.0) * inverse;
  }
  // Separate sums of even and odd terms shorten the dependency chain.
  const Lanes<W> square = halved * halved;
  Lanes<W> even = 1.0 / 41;
  Lanes<W> odd = 1.0 / 43;
  for (int n = 18; n >= 0; n -= 2) {
    even = 1.0 / (2 * n + 1) + square * even;
    odd = 1.0 / (2 * n + 3) + square * odd;
  }
  const Lanes<W> series = even - halved * odd;
  return factor * series;
}

// g and dg/dq for q >= 0. T is double or Lanes.
template <typename T>
ValueAndDerivative<T> AtanRatio(T q) {
  const T value = AtanRatioValue(q);
  const auto near_zero = q < T(1e-2);
  T derivative(0);
  if (Any(near_zero)) {
    for (int n = 8; n >= 0; --n) {
      derivative =
          derivative * q + (n % 2 == 0 ? -1.0 : 1.0) * (n + 1.0) / (2 * n + 3);
    }
  }
  const T divisor = Select(near_zero, T(1), 2.0 * q * (1.0 + q));
  return {value,
          Select(near_zero, derivative, (1.0 - value * (1.0 + q)) / divisor)};
}

// h and dh/dx for |x| < pi/2.
inline ValueAndDerivative<double> TanRatio(double x) {
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
