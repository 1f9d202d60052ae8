#include "core/change/change_mixture.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "core/change/sized_change.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class ChangeMixtureTest : public ::testing::Test {
 protected:
  VectorXd Normal(Eigen::Index size) {
    VectorXd x(size);
    for (double& one : x) one = normal_(random_);
    return x;
  }
  double Uniform() { return uniform_(random_); }

  std::mt19937_64 random_{5};
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_{0, 1};
};

// Draws devices from the prior: for each, the mixture estimates the probability
// of a change, theta, and its uncertainty. All three must be right on average.
TEST_F(ChangeMixtureTest, IsCalibratedOverItsPrior) {
  constexpr int kDevices = 20'000;
  constexpr double kChanged = 0.3;
  MatrixXd L(2, 2);
  L << 400, 90, 90, 60;
  const Eigen::LLT<MatrixXd> llt(L);
  const MatrixXd by_change = (MatrixXd(3, 2) << 1, 0.5, 0, 2, -1, 0).finished();
  double claimed = 0;
  double changed = 0;
  double nees = 0;
  MatrixXd errors = MatrixXd::Zero(3, 3);
  MatrixXd covariance = MatrixXd::Zero(3, 3);
  for (int device = 0; device < kDevices; ++device) {
    VectorXd y = VectorXd::Zero(2);
    if (Uniform() < kChanged) {
      changed += 1;
      const auto k = static_cast<std::size_t>(Uniform() * kChangeSizes.size());
      y = kChangeSizes[k] * Normal(2);
    }
    const VectorXd s = L * y + llt.matrixL() * Normal(2);
    ChangeMixture mixture;
    mixture.Add(L, s, by_change, kChanged);
    const ChangeDoubt doubt = mixture.Doubt();
    // Two steps: g++ 12 takes a temporary of one for used after its end.
    VectorXd error = by_change * y;
    error -= doubt.step;
    claimed += doubt.probability;
    errors += error * error.transpose();
    covariance += doubt.covariance;
    const MatrixXd own = doubt.covariance + 1e-4 * MatrixXd::Identity(3, 3);
    const VectorXd with_own = error + 1e-2 * Normal(3);
    nees += with_own.dot(own.llt().solve(with_own));
  }
  EXPECT_NEAR(claimed / kDevices, changed / kDevices, 0.01);
  EXPECT_LT((errors - covariance).norm(), 0.05 * covariance.norm());
  EXPECT_NEAR(nees / kDevices, 3, 0.1);
}

TEST_F(ChangeMixtureTest, TheMoreLikelyOfTwoCoursesDominates) {
  const MatrixXd L = MatrixXd::Constant(1, 1, 1e4);
  ChangeMixture mixture;
  // Eight sigmas of the one, half a sigma of the other.
  mixture.Add(
      L, VectorXd::Constant(1, 800), (MatrixXd(2, 1) << 1, 0).finished(), 0.01);
  mixture.Add(
      L, VectorXd::Constant(1, 50), (MatrixXd(2, 1) << 0, 1).finished(), 0.49);
  const ChangeDoubt doubt = mixture.Doubt();
  EXPECT_GT(doubt.probability, 0.999);
  EXPECT_NEAR(doubt.step(0), 0.08, 0.002);
  EXPECT_NEAR(std::sqrt(doubt.covariance(0, 0)), 0.01, 0.001);
  EXPECT_LT(std::abs(doubt.step(1)), 1e-5);
}

TEST_F(ChangeMixtureTest, WithoutInformationThePriorRemains) {
  ChangeMixture mixture;
  mixture.Add(
      MatrixXd::Zero(1, 1), VectorXd::Zero(1), MatrixXd::Identity(1, 1), 0.25);
  const ChangeDoubt doubt = mixture.Doubt();
  EXPECT_NEAR(doubt.probability, 0.25, 1e-12);
  EXPECT_EQ(doubt.step(0), 0);
  EXPECT_NEAR(
      doubt.covariance(0, 0), (1e-4 + 9e-4 + 1e-2 + 9e-2 + 1) / 5 / 4, 1e-12);
}

// Compared with the integral over y.
TEST(SizedChange, EvidenceMeanAndVarianceAreThoseOfTheDefinition) {
  const double L = 50;
  const double s = 12;
  const double size = 0.3;
  double evidence = 0;
  double mean = 0;
  double square = 0;
  constexpr double kStep = 1e-4;
  for (double y = -4; y < 4; y += kStep) {
    const double weight = kStep * std::exp(s * y - L * y * y / 2) *
                          std::exp(-y * y / (2 * size * size)) /
                          (size * std::sqrt(2 * M_PI));
    evidence += weight;
    mean += weight * y;
    square += weight * y * y;
  }
  mean /= evidence;
  const SizedChange change =
      ChangeOfSize(MatrixXd::Constant(1, 1, L), VectorXd::Constant(1, s), size);
  EXPECT_NEAR(change.log_evidence, std::log(evidence), 1e-6);
  EXPECT_NEAR(change.mean(0), mean, 1e-6);
  EXPECT_NEAR(change.covariance(0, 0), square / evidence - mean * mean, 1e-6);
}

}  // namespace
}  // namespace selfcal
