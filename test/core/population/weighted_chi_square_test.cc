#include "core/population/weighted_chi_square.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "core/change/chi_square.h"

namespace selfcal {
namespace {

TEST(WeightedChiSquare, IsTheChiSquareOfEqualWeights) {
  for (const auto& [degrees, accuracy] :
       {std::pair(1, 0.12), std::pair(2, 0.06), std::pair(10, 0.012)}) {
    const Eigen::ArrayXd weights = Eigen::ArrayXd::Constant(degrees, 0.3);
    for (const double per_degree : {0.3, 0.9, 1.0, 1.1, 2.0, 5.0, 12.0}) {
      const double statistic = per_degree * degrees;
      const double exact = ChiSquareTail(statistic, degrees);
      EXPECT_NEAR(
          WeightedChiSquareTail(0.3 * statistic, weights) / exact, 1, accuracy)
          << degrees << " degrees, " << statistic;
    }
  }
}

TEST(WeightedChiSquare, IsThatOfSimulatedSums) {
  const Eigen::ArrayXd weights =
      (Eigen::ArrayXd(8) << 0.9, 0.5, 0.2, 0.1, 0.1, 0.05, 0.01, 0).finished();
  constexpr int kDraws = 400'000;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::vector<double> sums(kDraws);
  for (double& sum : sums) {
    for (const double weight : weights) {
      const double z = normal(random);
      sum += weight * z * z;
    }
  }
  for (const double statistic : {1.0, 2.0, 4.0, 8.0}) {
    const auto larger = static_cast<double>(std::count_if(
        sums.begin(), sums.end(), [&](double sum) { return sum > statistic; }));
    // A tenth, and three standard deviations of the count.
    EXPECT_NEAR(kDraws * WeightedChiSquareTail(statistic, weights),
                larger,
                0.1 * larger + 3 * std::sqrt(larger))
        << statistic;
  }
}

TEST(WeightedChiSquare, FallsSmoothlyThroughTheMean) {
  const Eigen::ArrayXd weights = Eigen::ArrayXd::LinSpaced(6, 0.1, 0.6);
  const double mean = weights.sum();
  double last = 1;
  for (double statistic = 0.99 * mean; statistic < 1.01 * mean;
       statistic += 1e-4 * mean) {
    const double tail = WeightedChiSquareTail(statistic, weights);
    EXPECT_LT(tail, last) << statistic;
    EXPECT_GT(tail, last - 1e-3 - (last == 1 ? 1 : 0)) << statistic;
    last = tail;
  }
}

TEST(WeightedChiSquare, OfNoWeightIsCertain) {
  EXPECT_EQ(WeightedChiSquareTail(0, Eigen::ArrayXd()), 1);
  EXPECT_EQ(WeightedChiSquareTail(1, Eigen::ArrayXd::Zero(3)), 1);
  EXPECT_EQ(WeightedChiSquareTail(0, Eigen::ArrayXd::Ones(3)), 1);
}

}  // namespace
}  // namespace selfcal
