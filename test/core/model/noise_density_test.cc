#include "core/model/noise_density.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace selfcal {
namespace {

// The definition, by simulation: the integral of readings over one second
// deviates by the density.
TEST(NoiseDensity, IsTheDeviationOfTheIntegralOverASecond) {
  constexpr double kSigma = 0.3;
  constexpr int kSeconds = 4000;
  for (const int rate_hz : {100, 400}) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> reading(0, kSigma);
    double sum_of_squares = 0;
    for (int second = 0; second < kSeconds; ++second) {
      double integral = 0;
      for (int i = 0; i < rate_hz; ++i) integral += reading(random) / rate_hz;
      sum_of_squares += integral * integral;
    }
    const double measured = std::sqrt(sum_of_squares / kSeconds);
    // A standard deviation of n samples is known to 1 / sqrt(2 n).
    EXPECT_NEAR(NoiseDensity(kSigma, rate_hz) / measured,
                1,
                4 / std::sqrt(2.0 * kSeconds));
  }
}

TEST(NoiseDensity, ReadingSigmaIsTheInverse) {
  EXPECT_DOUBLE_EQ(NoiseDensity(ReadingSigma(1.7e-4, 200), 200), 1.7e-4);
  EXPECT_DOUBLE_EQ(ReadingSigma(0.01, 400), 0.2);
}

}  // namespace
}  // namespace selfcal
