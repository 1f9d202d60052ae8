#include "core/simulation/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace selfcal {
namespace {

constexpr int kDraws = 200000;

TEST(RandomTest, TheEngineIsTheOneOfTheStandard) {
  // The standard requires this value: if it holds, so do all bits derived from
  // the engine without its library's distributions.
  std::mt19937_64 engine;
  engine.discard(9999);
  EXPECT_EQ(engine(), 9981545732273789042ULL);
}

TEST(RandomTest, SeedAndStreamTogetherDetermineTheNumbers) {
  Random a(3, 1);
  Random b(3, 1);
  Random other_stream(3, 2);
  Random other_seed(4, 1);
  for (int i = 0; i < 100; ++i) {
    const double x = a.Normal();
    EXPECT_EQ(x, b.Normal());
    EXPECT_NE(x, other_stream.Normal());
    EXPECT_NE(x, other_seed.Normal());
  }
}

TEST(RandomTest, NormalNumbersHaveTheMomentsOfTheNormalDistribution) {
  Random random(5, 0);
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0, neighbours = 0, last = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Normal();
    m1 += x / kDraws;
    m2 += x * x / kDraws;
    m3 += x * x * x / kDraws;
    m4 += x * x * x * x / kDraws;
    neighbours += x * last / kDraws;
    last = x;
  }
  // Five standard deviations of each mean.
  const double n = std::sqrt(kDraws);
  EXPECT_NEAR(m1, 0, 5 / n);
  EXPECT_NEAR(m2, 1, 5 * std::sqrt(2) / n);
  EXPECT_NEAR(m3, 0, 5 * std::sqrt(15) / n);
  EXPECT_NEAR(m4, 3, 5 * std::sqrt(96) / n);
  EXPECT_NEAR(neighbours, 0, 5 / n);
}

TEST(RandomTest, UniformNumbersFillTheirInterval) {
  Random random(6, 0);
  double sum = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Uniform(-2, 6);
    ASSERT_GE(x, -2);
    ASSERT_LT(x, 6);
    sum += x / kDraws;
  }
  EXPECT_NEAR(sum, 2, 5 * 8 / std::sqrt(12.0 * kDraws));
}

TEST(RandomTest, GammaNumbersHaveTheMomentsOfTheGammaDistribution) {
  for (const double shape : {0.4, 0.75, 1.0, 6.0}) {
    Random random(9, 0);
    double sum = 0, squares = 0, logs = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double x = random.Gamma(shape);
      ASSERT_GT(x, 0);
      sum += x / kDraws;
      squares += (x - shape) * (x - shape) / kDraws;
      logs += std::log(x) / kDraws;
    }
    // The mean of the logarithm is the digamma function: the derivative of
    // lgamma.
    const double digamma =
        (std::lgamma(shape + 1e-4) - std::lgamma(shape - 1e-4)) / 2e-4;
    EXPECT_NEAR(sum, shape, 5 * std::sqrt(shape / kDraws));
    EXPECT_NEAR(squares,
                shape,
                5 * std::sqrt((2 * shape * shape + 6 * shape) / kDraws));
    // The variance of the logarithm is below 1 / shape + 1 / shape^2.
    EXPECT_NEAR(logs,
                digamma,
                5 * std::sqrt((1 / shape + 1 / (shape * shape)) / kDraws));
  }
}

TEST(RandomTest, ChancesHaveTheStatedProbability) {
  Random random(7, 0);
  double sum = 0;
  for (int i = 0; i < kDraws; ++i) sum += random.Chance(0.03);
  EXPECT_NEAR(sum / kDraws, 0.03, 5 * std::sqrt(0.03 / kDraws));
  EXPECT_FALSE(random.Chance(0));
  EXPECT_TRUE(random.Chance(1));
}

TEST(RandomTest, DirectionsAreUnitAndPreferNoSide) {
  Random random(8, 0);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d d = random.Direction();
    ASSERT_NEAR(d.norm(), 1, 1e-12);
    mean += d / kDraws;
    moment += d * d.transpose() / kDraws;
  }
  const double bound = 5 / std::sqrt(kDraws);
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), bound);
  EXPECT_LT((moment - Eigen::Matrix3d::Identity() / 3).cwiseAbs().maxCoeff(),
            bound);
}

}  // namespace
}  // namespace selfcal
