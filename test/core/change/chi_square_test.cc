#include "core/change/chi_square.h"

#include <gtest/gtest.h>

#include <cmath>

namespace selfcal {
namespace {

TEST(ChiSquareTail, IsThatOfPrintedTables) {
  // 95 % and 99.9 % quantiles.
  EXPECT_NEAR(ChiSquareTail(3.841459, 1), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(5.991465, 2), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(38.885139, 26), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(10.827566, 1), 0.001, 1e-9);
  EXPECT_NEAR(ChiSquareTail(149.449253, 100), 0.001, 1e-9);
}

TEST(ChiSquareTail, HasTheDensityForASlope) {
  for (int degrees = 1; degrees <= 60; ++degrees) {
    for (const double x : {0.3, 2.0, 15.0, 80.0}) {
      const double half = degrees / 2.0;
      const double density = std::exp((half - 1) * std::log(x) - x / 2 -
                                      half * std::log(2) - std::lgamma(half));
      const double h = 1e-4 * x;
      const double slope =
          (ChiSquareTail(x + h, degrees) - ChiSquareTail(x - h, degrees)) /
          (2 * h);
      // Tolerance of the difference, and of the rounding of two numbers near 1.
      EXPECT_NEAR(-slope, density, 1e-6 * density + 1e-15 / h)
          << degrees << " degrees at " << x;
    }
  }
}

TEST(ChiSquareTail, StaysAProbabilityFarOut) {
  EXPECT_EQ(ChiSquareTail(0, 5), 1);
  EXPECT_EQ(ChiSquareTail(1e6, 5), 0);
  EXPECT_EQ(ChiSquareTail(1e300, 400), 0);
  EXPECT_NEAR(ChiSquareTail(1, 2000), 1, 1e-12);
  // exp(-x / 2) for two degrees.
  EXPECT_NEAR(std::log(ChiSquareTail(1200, 2)), -600, 1e-9);
}

}  // namespace
}  // namespace selfcal
