#include "core/model/monotonic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "test/core/model/random_values.h"
#include "test/core/model/special_values.h"

namespace selfcal {
namespace {

constexpr int kMonotonicTrials = 5000;

// The smallest value of the slope on [0, q], by brute force.
double SmallestSlope(const std::array<double, 4>& k, double q) {
  double smallest = 1;
  constexpr int kSteps = 2000;
  for (int i = 1; i <= kSteps; ++i) {
    const double Q = q * i / kSteps;
    const double slope =
        1 + Q * (3 * k[0] + Q * (5 * k[1] + Q * (7 * k[2] + Q * 9 * k[3])));
    smallest = std::min(smallest, slope);
  }
  return smallest;
}

TEST(ProfileRises, AgreesWithTheSmallestSlope) {
  RandomValues random(1);
  int rising = 0;
  int falling = 0;
  for (int i = 0; i < kMonotonicTrials; ++i) {
    std::array<double, 4> k;
    for (double& value : k) value = random.Uniform(-1, 1);
    const double q = random.Uniform(0, 2.5);
    const double smallest = SmallestSlope(k, q);
    if (std::abs(smallest) < 1e-3) continue;  // undecidable by brute force
    const bool rises = ProfileRises(k, q);
    EXPECT_EQ(rises, smallest > 0) << smallest;
    ++(rises ? rising : falling);
  }
  EXPECT_GT(rising, kMonotonicTrials / 10);
  EXPECT_GT(falling, kMonotonicTrials / 10);
}

TEST(ProfileRises, EndsAtTheFirstZeroOfTheSlope) {
  RandomValues random(2);
  for (int i = 0; i < kMonotonicTrials; ++i) {
    // (1 - q / a) (1 - q / b): zeros at a and b, rising again beyond b.
    const double a = random.Uniform(0.01, 10);
    const double b = a * random.Uniform(1.001, 3);
    const std::array<double, 2> k = {-(1 / a + 1 / b) / 3, 1 / (a * b) / 5};
    EXPECT_TRUE(ProfileRises(k, a * (1 - 1e-6)));
    EXPECT_FALSE(ProfileRises(k, a * (1 + 1e-6)));
    EXPECT_FALSE(ProfileRises(k, (a + b) / 2));
    EXPECT_FALSE(ProfileRises(k, 2 * b));
    EXPECT_FALSE(ProfileRises(k, 100 * b));
  }
}

TEST(ProfileRises, DoesNotEndWhereTheSlopeStaysJustAboveZero) {
  RandomValues random(3);
  for (int i = 0; i < kMonotonicTrials; ++i) {
    // ((q / a - 1)^2 + c) / (1 + c) has its minimum c / (1 + c) at a.
    const double a = random.Uniform(0.01, 10);
    const double c = std::abs(random.SignedMagnitude(1e-9, 1));
    const std::array<double, 2> k = {-2 / (a * (1 + c)) / 3,
                                     1 / (a * a * (1 + c)) / 5};
    EXPECT_TRUE(ProfileRises(k, a));
    EXPECT_TRUE(ProfileRises(k, 100 * a));
  }
}

// Coefficients of the product of (1 - q / a) over the zeros a; the first one,
// 1, is left out.
template <std::size_t N>
std::array<double, N> WithZeros(const std::array<double, N>& zeros) {
  std::array<double, N + 1> product = {1};
  for (const double zero : zeros) {
    for (std::size_t i = N; i > 0; --i) product[i] -= product[i - 1] / zero;
  }
  std::array<double, N> c;
  for (std::size_t i = 0; i < N; ++i) c[i] = product[i + 1];
  return c;
}

template <std::size_t N>
void ExpectTheFirstZeroToBeTheEnd(unsigned seed) {
  RandomValues random(seed);
  for (int i = 0; i < kMonotonicTrials; ++i) {
    std::array<double, N> zeros;
    for (double& zero : zeros) zero = random.Uniform(1, 3);
    const double first = *std::min_element(zeros.begin(), zeros.end());
    const std::array<double, N> c = WithZeros(zeros);
    EXPECT_TRUE(PositiveUpTo(c, first * (1 - 1e-4)));
    EXPECT_FALSE(PositiveUpTo(c, first * (1 + 1e-4)));
    EXPECT_FALSE(PositiveUpTo(c, 4.0));
  }
}

TEST(PositiveUpTo, EndsAtTheFirstZeroOfAnyDegree) {
  ExpectTheFirstZeroToBeTheEnd<2>(4);
  ExpectTheFirstZeroToBeTheEnd<3>(5);
  ExpectTheFirstZeroToBeTheEnd<4>(6);
  ExpectTheFirstZeroToBeTheEnd<6>(7);
}

TEST(ProfileRises, IsFalseForWhatIsNotANumber) {
  EXPECT_FALSE(ProfileRises(std::array{kNan, 0.0}, 1.0));
  EXPECT_FALSE(ProfileRises(std::array{0.1, kNan}, 1.0));
  EXPECT_FALSE(ProfileRises(std::array{0.1, 0.1}, kNan));
}

}  // namespace
}  // namespace selfcal
