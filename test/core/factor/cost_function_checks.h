// Evaluates a Ceres cost function and compares its Jacobians with differences
// through the manifolds of its blocks.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <vector>

#include "test/core/factor/random_values.h"
#include "test/core/model/rounding.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {

using Blocks = std::vector<Eigen::VectorXd>;
using RowMajorXd =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct CostEvaluation {
  Eigen::VectorXd residuals;
  std::vector<RowMajorXd> jacobians;  // by the ambient values of each block
};

inline CostEvaluation EvaluateCost(const ceres::CostFunction& cost,
                                   const Blocks& blocks,
                                   bool with_jacobians) {
  CostEvaluation result;
  result.residuals.setConstant(cost.num_residuals(), NAN);
  std::vector<const double*> parameters;
  std::vector<double*> jacobians;
  EXPECT_EQ(cost.parameter_block_sizes().size(), blocks.size());
  result.jacobians.reserve(blocks.size());
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    EXPECT_EQ(cost.parameter_block_sizes()[i], blocks[i].size());
    parameters.push_back(blocks[i].data());
    result.jacobians.push_back(
        RowMajorXd::Constant(cost.num_residuals(), blocks[i].size(), NAN));
    jacobians.push_back(result.jacobians.back().data());
  }
  EXPECT_TRUE(cost.Evaluate(parameters.data(),
                            result.residuals.data(),
                            with_jacobians ? jacobians.data() : nullptr));
  return result;
}

// `manifolds` has an entry for each block, null for a Euclidean one.
inline void ExpectJacobiansMatch(
    const ceres::CostFunction& cost,
    const Blocks& blocks,
    const std::vector<const ceres::Manifold*>& manifolds,
    double step,
    double tolerance) {
  const CostEvaluation at = EvaluateCost(cost, blocks, true);
  ExpectSameFormula(at.residuals, EvaluateCost(cost, blocks, false).residuals);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const ceres::Manifold* manifold = manifolds[i];
    const auto moved = [&](const Eigen::VectorXd& delta) -> Eigen::VectorXd {
      Blocks m = blocks;
      if (manifold == nullptr) {
        m[i] += delta;
      } else {
        manifold->Plus(blocks[i].data(), delta.data(), m[i].data());
      }
      return EvaluateCost(cost, m, false).residuals;
    };
    Eigen::MatrixXd analytic = at.jacobians[i];
    if (manifold != nullptr) {
      RowMajorXd plus(manifold->AmbientSize(), manifold->TangentSize());
      manifold->PlusJacobian(blocks[i].data(), plus.data());
      analytic = at.jacobians[i] * plus;
    }
    const Eigen::MatrixXd numeric =
        NumericJacobian(moved, static_cast<int>(analytic.cols()), step);
    EXPECT_LT(RowwiseDifference(analytic, numeric), tolerance) << "block " << i;
  }
}

// Ceres requests only some blocks if the others are constant.
inline void ExpectBlocksCanBeLeftOut(const ceres::CostFunction& cost,
                                     const Blocks& blocks) {
  const CostEvaluation all = EvaluateCost(cost, blocks, true);
  std::vector<const double*> parameters;
  for (const auto& block : blocks) parameters.push_back(block.data());
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    Eigen::VectorXd residuals(cost.num_residuals());
    RowMajorXd jacobian(cost.num_residuals(), blocks[i].size());
    std::vector<double*> jacobians(blocks.size(), nullptr);
    jacobians[i] = jacobian.data();
    EXPECT_TRUE(
        cost.Evaluate(parameters.data(), residuals.data(), jacobians.data()));
    EXPECT_EQ(residuals, all.residuals);
    EXPECT_EQ(jacobian, all.jacobians[i]);
  }
}

}  // namespace selfcal
