// Tests whether a radial profile r (1 + k_1 r^2 + k_2 r^4 + ...) is increasing.
// A distortion model is one-to-one up to the first zero of its derivative, and
// must not be used beyond it, although the formula gives a number there.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "core/simd/lanes.h"

namespace selfcal {

// Returns true if the polynomial with Bernstein coefficients b is positive on
// [0, 1]. The curve lies in the convex hull of its coefficients and its end
// points are the first and the last one; if that does not decide, the interval
// is halved (de Casteljau). A polynomial that is undecided after `halvings`
// touches zero up to rounding and is treated as not positive.
template <std::size_t N>
bool PositiveInBernsteinForm(const std::array<double, N>& b, int halvings) {
  if (!(b.front() > 0 && b.back() > 0)) return false;
  bool all_positive = true;
  for (const double value : b) all_positive = all_positive && value > 0;
  if (all_positive) return true;
  if (halvings == 0) return false;
  std::array<double, N> left;
  std::array<double, N> right = b;
  for (std::size_t i = 0; i < N; ++i) {
    left[i] = right[0];
    for (std::size_t j = 0; j + 1 < N - i; ++j) {
      right[j] = (right[j] + right[j + 1]) / 2;
    }
  }
  return PositiveInBernsteinForm(left, halvings - 1) &&
         PositiveInBernsteinForm(right, halvings - 1);
}

// Returns true if the polynomial with the coefficients a[0] .. a[degree] is
// positive on [0, 1]. The degree is 2, 3, 4 or 6.
bool PositiveOnUnitInterval(const double* a, int degree);

// Returns true if 1 + c_1 q + .. + c_N q^N is positive on [0, q]. Returns false
// if any input is NaN. T is double or Lanes, not an integer: powers would
// overflow.
template <std::size_t N, typename T>
requires(!std::is_integral_v<T>) auto PositiveUpTo(
    const std::array<double, N>& c, T q) {
  // The variable is scaled to [0, 1]; only the powers of q that occur are
  // computed.
  std::array<T, N + 1> a;
  a[0] = T(1);
  T power(1);
  T negative(0);
  for (std::size_t i = 1; i <= N; ++i) {
    power *= q;
    a[i] = c[i - 1] * power;
    negative += Select(a[i] >= T(0), T(0), a[i]);
  }
  // This bound decides for nearly every point of a real lens.
  const auto surely = 1.0 + negative > T(0);
  if (All(surely)) return surely;
  return surely || AskEachLane<T>([&](int lane) {
           double of_lane[N + 1];
           for (std::size_t i = 0; i <= N; ++i) of_lane[i] = Lane(a[i], lane);
           return PositiveOnUnitInterval(of_lane, static_cast<int>(N));
         });
}

// Returns true if the derivative of r (1 + sum k_i r^(2i)) is positive on [0,
// r], with q = r^2: the polynomial 1 + sum (2i + 1) k_i q^i on [0, q]. False
// for NaN.
template <std::size_t N, typename T>
requires(!std::is_integral_v<T>) auto ProfileRises(
    const std::array<double, N>& k, T q) {
  std::array<double, N> slope;
  for (std::size_t i = 0; i < N; ++i) {
    slope[i] = static_cast<double>(2 * i + 3) * k[i];
  }
  return PositiveUpTo(slope, q);
}

}  // namespace selfcal
