#include "core/model/distortion_series.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kSeriesTrials = 5000;
using Real = long double;

// Sums term(0) + term(1) + ... until terms are negligible: a reference without
// a switch between two formulas.
Real Sum(const std::function<Real(int)>& term) {
  Real sum = 0;
  for (int n = 0; n < 400; ++n) sum += term(n);
  return sum;
}

TEST(AtanRatio, AgreesWithItsPowerSeries) {
  RandomValues random(1);
  for (int i = 0; i < kSeriesTrials; ++i) {
    const double q = std::abs(random.SignedMagnitude(1e-30, 0.8));
    const auto sign = [](int n) { return n % 2 == 0 ? 1 : -1; };
    const Real value = Sum([&](int n) -> Real {
      return sign(n) * std::pow(Real(q), n) / (2 * n + 1);
    });
    const Real derivative = Sum([&](int n) -> Real {
      return -sign(n) * (n + 1) * std::pow(Real(q), n) / (2 * n + 3);
    });
    const ValueAndDerivative g = AtanRatio(q);
    EXPECT_NEAR(g.value / static_cast<double>(value), 1, 1e-15) << q;
    EXPECT_NEAR(g.derivative / static_cast<double>(derivative), 1, 1e-13) << q;
  }
}

TEST(AtanRatio, AgreesWithTheArcTangentForLargeArguments) {
  RandomValues random(2);
  for (int i = 0; i < kSeriesTrials; ++i) {
    const double q = std::abs(random.SignedMagnitude(0.5, 1e40));
    const Real root = std::sqrt(Real(q));
    const Real value = std::atan(root) / root;
    const Real derivative = (1 / (1 + Real(q)) - value) / (2 * Real(q));
    const ValueAndDerivative g = AtanRatio(q);
    EXPECT_NEAR(g.value / static_cast<double>(value), 1, 1e-15) << q;
    EXPECT_NEAR(g.derivative / static_cast<double>(derivative), 1, 1e-14) << q;
  }
}

TEST(TanRatio, AgreesWithTheTangent) {
  RandomValues random(3);
  for (int i = 0; i < kSeriesTrials; ++i) {
    const double x = random.SignedMagnitude(1e-150, 1.57);
    const double expected = static_cast<double>(std::tan(Real(x)) / Real(x));
    EXPECT_NEAR(TanRatio(x).value / expected, 1, 1e-15) << x;
  }
}

TEST(TanRatio, HasTheDerivativeOfTheTangentRatio) {
  RandomValues random(4);
  for (int i = 0; i < kSeriesTrials; ++i) {
    const double x = random.SignedMagnitude(1e-3, 1.57);
    const Real t = std::tan(Real(x));
    const Real expected = (1 + t * t - t / x) / x;
    EXPECT_NEAR(
        TanRatio(x).derivative / static_cast<double>(expected), 1, 3e-13)
        << x;
  }
  // Below, the leading term is exact to the next one, 4 x^2 / 5 of it.
  for (int i = 0; i < kSeriesTrials; ++i) {
    const double x = random.SignedMagnitude(1e-100, 1e-3);
    EXPECT_NEAR(TanRatio(x).derivative / (2 * x / 3), 1 + 0.8 * x * x, 1e-11);
  }
  EXPECT_EQ(TanRatio(0).derivative, 0);
}

}  // namespace
}  // namespace selfcal
