#include "test/evaluation/statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/change/chi_square.h"
#include "core/model/so3.h"
#include "core/simulation/random.h"

namespace selfcal {
namespace {

TEST(Statistics, OfSmallSets) {
  const std::vector<double> values = {4, 1, 3, 2};
  EXPECT_DOUBLE_EQ(Mean(values), 2.5);
  EXPECT_DOUBLE_EQ(Rms(values), std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(StandardDeviation(values), std::sqrt(5.0 / 3));
  EXPECT_DOUBLE_EQ(MedianOf(values), 2.5);
  EXPECT_DOUBLE_EQ(Quantile(values, 0), 1);
  EXPECT_DOUBLE_EQ(Quantile(values, 1), 4);
  EXPECT_DOUBLE_EQ(Quantile(values, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(MedianOf({7}), 7);
}

TEST(RankCorrelation, SeesOrderAlone) {
  EXPECT_DOUBLE_EQ(RankCorrelation({1, 2, 3, 4}, {1, 10, 100, 1000}), 1);
  EXPECT_DOUBLE_EQ(RankCorrelation({1, 2, 3, 4}, {4, 3, 2, -7}), -1);
  // 1 - 6 sum d^2 / (n (n^2 - 1)) without ties.
  EXPECT_NEAR(RankCorrelation({1, 2, 3, 4, 5}, {2, 1, 4, 3, 5}), 0.8, 1e-12);
  // Ranks (1.5, 1.5, 3) and (1, 2, 3).
  EXPECT_NEAR(
      RankCorrelation({5, 5, 6}, {1, 2, 3}), 1.5 / std::sqrt(3.0), 1e-12);
}

// Tables of the distribution.
TEST(ChiSquare, AgreesWithTables) {
  EXPECT_NEAR(ChiSquareQuantile(0.95, 1), 3.841459, 1e-6);
  EXPECT_NEAR(ChiSquareQuantile(0.99, 10), 23.209251, 1e-6);
  EXPECT_NEAR(ChiSquareQuantile(0.025, 26), 13.843905, 1e-6);
  EXPECT_NEAR(ChiSquareQuantile(0.975, 26), 41.923170, 1e-6);
  EXPECT_NEAR(ChiSquareQuantile(0.5, 100), 99.334129, 1e-6);
}

TEST(ChiSquare, QuantileInvertsTheDistribution) {
  for (const int dof : {1, 2, 7, 26, 2600}) {
    for (const double p : {1e-6, 0.025, 0.5, 0.975, 1 - 1e-6}) {
      EXPECT_NEAR(ChiSquareTail(ChiSquareQuantile(p, dof), dof), 1 - p, 1e-10);
    }
  }
}

TEST(NeesBounds, NarrowWithTheRuns) {
  const auto [low, high] = NeesBounds(26, 1, 0.95);
  EXPECT_NEAR(low, 13.843905, 1e-6);
  EXPECT_NEAR(high, 41.923170, 1e-6);
  const auto [low_100, high_100] = NeesBounds(26, 100, 0.95);
  // Normal with variance 2 dof / runs, nearly.
  EXPECT_NEAR(low_100, 26 - 1.96 * std::sqrt(0.52), 0.03);
  EXPECT_NEAR(high_100, 26 + 1.96 * std::sqrt(0.52), 0.03);
}

TEST(Binomial, TailIsThatOfCoins) {
  EXPECT_NEAR(BinomialTail(0, 4, 0.5), 1, 1e-12);
  EXPECT_NEAR(BinomialTail(2, 4, 0.5), 11.0 / 16, 1e-12);
  EXPECT_NEAR(BinomialTail(4, 4, 0.5), 1.0 / 16, 1e-12);
  EXPECT_NEAR(BinomialTail(1, 1200, 0.01), 1 - std::pow(0.99, 1200), 1e-10);
}

TEST(Binomial, UpperBoundHasTheTail) {
  EXPECT_NEAR(
      BinomialUpperBound(0, 3000, 0.999), 1 - std::pow(1e-3, 1 / 3000.0), 1e-9);
  const double bound = BinomialUpperBound(7, 500, 0.95);
  EXPECT_NEAR(BinomialTail(8, 500, bound), 0.95, 1e-9);
  EXPECT_EQ(BinomialUpperBound(5, 5, 0.95), 1);
}

TEST(AverageRotation, OfTwoIsHalfWay) {
  const Eigen::Quaterniond a = Exp({0.3, -0.2, 0.9});
  const Eigen::Vector3d step(0.4, 0.2, -0.3);
  const Eigen::Quaterniond b = a * Exp(step);
  // The other sign is the same rotation.
  const Eigen::Quaterniond minus_b(-b.coeffs());
  const Eigen::Quaterniond mean = AverageRotation({a, minus_b});
  EXPECT_LT(Log(mean.conjugate() * a * Exp(step / 2)).norm(), 1e-12);
}

TEST(AverageRotation, TurnsWithItsRotations) {
  Random random(1, 99);
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<Eigen::Quaterniond> turned;
  const Eigen::Quaterniond turn = Exp({2, -1, 0.5});
  for (int i = 0; i < 7; ++i) {
    rotations.push_back(Exp(0.5 * random.Direction()));
    turned.push_back(turn * rotations.back());
  }
  const Eigen::Quaterniond mean = AverageRotation(rotations);
  EXPECT_LT(Log((turn * mean).conjugate() * AverageRotation(turned)).norm(),
            1e-12);
}

TEST(SpreadOfRotations, IsThatOfTheAnglesDrawn) {
  Random random(2, 99);
  const Eigen::Quaterniond mean = Exp({1, 2, -0.5});
  const Eigen::Vector3d sigma(0.01, 0.02, 0.005);
  std::vector<Eigen::Quaterniond> rotations;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d delta = sigma.cwiseProduct(
        Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
    rotations.push_back(mean * Exp(delta));
  }
  const RotationSpread spread = SpreadOfRotations(rotations);
  EXPECT_LT(
      (spread.axes_rad - sigma).cwiseQuotient(sigma).cwiseAbs().maxCoeff(),
      0.03);
  EXPECT_NEAR(spread.angle_rad, spread.axes_rad.norm(), 1e-15);
  EXPECT_LT(Log(mean.conjugate() * AverageRotation(rotations)).norm(), 1e-3);
}

TEST(Statistics, BinomialBoundsLeaveOutHalfOfTheRestOnEachSide) {
  // 10 throws of a coin: 1 or fewer heads in 11 of 1024, 2 or fewer in 56.
  EXPECT_EQ(BinomialBounds(10, 0.5, 0.95), std::make_pair(2, 8));
  EXPECT_EQ(BinomialBounds(10, 0.5, 1 - 2 * 10.9 / 1024), std::make_pair(1, 9));
  EXPECT_EQ(BinomialBounds(10, 0.5, 1 - 2 * 11.1 / 1024), std::make_pair(2, 8));
  // All of them may be hits where misses are rare.
  EXPECT_EQ(BinomialBounds(100, 0.9973, 0.95).second, 100);
}

TEST(Statistics, SquaredErrorIsOfWhatIsEstimated) {
  // Two components that go together, in units far apart, and a fixed one.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance(0, 0) = 4;
  covariance(2, 2) = 1e-20;
  covariance(0, 2) = covariance(2, 0) = 0.5 * 2 * 1e-10;
  const auto [nees, dof] =
      NormalisedSquaredError(Eigen::Vector3d(2, 0, 2e-10), covariance);
  EXPECT_EQ(dof, 2);
  // (1, 2) C^-1 (1, 2)^T with C = (1 0.5; 0.5 1).
  EXPECT_NEAR(nees, (1 - 2 + 4) / 0.75, 1e-12);
}

}  // namespace
}  // namespace selfcal
