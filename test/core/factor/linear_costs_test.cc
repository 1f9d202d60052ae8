#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>

#include "core/factor/ceres_factors.h"
#include "test/core/factor/cost_function_checks.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(BiasWalkCost, IsTheChangeOfTheBiasesInSigmas) {
  RandomValues random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix<double, 6, 1> sigmas =
        BiasWalkSigmas({.gyro_noise_density = 1,
                        .accel_noise_density = 1,
                        .gyro_bias_random_walk = random.LogUniform(1e-6, 1e-2),
                        .accel_bias_random_walk = random.LogUniform(1e-4, 1)},
                       random.LogUniform(0.01, 100));
    const auto cost = MakeBiasWalkCost(sigmas);
    const Blocks blocks = {random.NormalVector(9), random.NormalVector(9)};
    const VectorXd expected =
        (blocks[1] - blocks[0]).tail(6).cwiseQuotient(sigmas);
    EXPECT_LT((EvaluateCost(*cost, blocks, false).residuals - expected).norm(),
              1e-14 * expected.norm());
    ExpectJacobiansMatch(*cost, blocks, {nullptr, nullptr}, 1e-3, 1e-10);
    ExpectBlocksCanBeLeftOut(*cost, blocks);
  }
}

TEST(PriorCost, IsTheWhitenedDistanceFromTheMean) {
  RandomValues random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 1 + random.Index(30);
    const int rows = 1 + random.Index(n);
    const MatrixXd square_root =
        random.NormalVector(rows * n).reshaped(rows, n);
    const VectorXd mean = random.NormalVector(n);
    const auto cost = MakePriorCost(square_root, mean);
    const Blocks blocks = {random.NormalVector(n)};
    const VectorXd expected = square_root * (blocks[0] - mean);
    EXPECT_LT((EvaluateCost(*cost, blocks, false).residuals - expected).norm(),
              1e-13);
    ExpectJacobiansMatch(*cost, blocks, {nullptr}, 1e-3, 1e-10);
  }
}

// In a solver: the prior pulls to its mean, inside the span and nowhere else.
TEST(PriorCost, ReachesItsMeanInsideTheSubspaceThatIsFree) {
  RandomValues random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd mean = random.NormalVector(8);
    const VectorXd start = random.NormalVector(8);
    MatrixXd basis = MatrixXd::Zero(8, 3);
    basis(1, 0) = basis(4, 1) = basis(6, 2) = 2;
    VectorXd x = start;
    ceres::Problem problem;
    problem.AddResidualBlock(
        MakePriorCost(MatrixXd::Identity(8, 8), mean).release(),
        nullptr,
        x.data());
    problem.SetManifold(x.data(), MakeSubspaceManifold(basis).release());
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-15;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    for (int i = 0; i < 8; ++i) {
      const bool is_free = i == 1 || i == 4 || i == 6;
      EXPECT_NEAR(x[i], is_free ? mean[i] : start[i], 1e-6);
    }
  }
}

}  // namespace
}  // namespace selfcal
