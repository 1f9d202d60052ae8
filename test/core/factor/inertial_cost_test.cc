#include <gtest/gtest.h>

#include "core/factor/ceres_factors.h"
#include "core/model/so3.h"
#include "test/core/factor/cost_function_checks.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kGravity = 9.81;

struct Factor {
  Calibration reference;
  VectorXd delta;  // of theta, from the reference
  std::vector<ImuSample> samples;
  ImuNoise noise;
  KeyframeState x0, x1;
  InertialMatrix W;

  std::unique_ptr<ceres::CostFunction> Cost() const {
    return MakeInertialCost(
        reference, samples, x0.t_ns, x1.t_ns, noise, kGravity, W);
  }
  InertialResidual Plain(InertialMatrix* covariance) const {
    return EvaluateInertial(samples,
                            x0,
                            x1,
                            BoxPlus(reference, delta).imu,
                            noise,
                            kGravity,
                            nullptr,
                            covariance);
  }
};

VectorXd VelocityAndBiases(const KeyframeState& x) {
  VectorXd vb(9);
  vb << x.v_GI, x.b_a, x.b_g;
  return vb;
}

Blocks BlocksOf(const Factor& factor) {
  return {factor.delta,
          factor.x0.q_GI.coeffs(),
          factor.x0.p_GI,
          VelocityAndBiases(factor.x0),
          factor.x1.q_GI.coeffs(),
          factor.x1.p_GI,
          VelocityAndBiases(factor.x1)};
}

Factor RandomFactor(RandomValues& random, double duration_s, bool coupled) {
  Factor factor;
  factor.reference.imu = coupled ? random.CoupledImu() : random.Imu();
  factor.reference.cameras = {random.Camera(DistortionModel::kFov),
                              random.Camera(DistortionModel::kEquidistant)};
  factor.delta = 0.02 * random.NormalVector(TangentSize(factor.reference));
  // Optional blocks: of the size of their values.
  const int more = ImuTangentSize(factor.reference.imu) - kImuTangentSize;
  factor.delta.segment(kImuTangentSize, more) *= 0.1;
  factor.delta.segment<3>(kAccelRotation) = random.Normal3(0.7);
  factor.samples = random.Samples(random.LogUniform(100, 1000), duration_s);
  factor.x0 = random.State(0);
  factor.x1 = random.State(static_cast<std::int64_t>(1e9 * duration_s));
  // Rotations that agree to within a radian, away from the jump at pi.
  const Preintegration motion = Preintegrate(factor.samples,
                                             factor.x0.t_ns,
                                             factor.x1.t_ns,
                                             factor.reference.imu,
                                             factor.x0.b_a,
                                             factor.x0.b_g,
                                             factor.noise);
  factor.x1.q_GI = factor.x0.q_GI * motion.Delta_R *
                   Exp(random.Uniform(0, 1) * random.Normal3(1).normalized());
  InertialMatrix covariance;
  factor.Plain(&covariance);
  factor.W = SquareRootInformation(covariance);
  return factor;
}

TEST(InertialCost, IsThePlainFactorWhitened) {
  RandomValues random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const Factor factor = RandomFactor(random, 0.1, trial % 2 == 1);
    const VectorXd expected = factor.W * factor.Plain(nullptr);
    const VectorXd residuals =
        EvaluateCost(*factor.Cost(), BlocksOf(factor), false).residuals;
    EXPECT_LT((residuals - expected).norm(), 1e-10 * expected.norm());
  }
}

TEST(InertialCost, JacobiansMatchDifferencesThroughBothManifolds) {
  RandomValues random(2);
  const auto full = MakeRotationManifold();
  const auto gauge = MakeGaugeRotationManifold();
  for (int trial = 0; trial < 300; ++trial) {
    const Factor factor =
        RandomFactor(random, trial % 20 == 0 ? 1 : 0.1, trial % 3 == 0);
    const auto* manifold = trial % 2 == 0 ? full.get() : gauge.get();
    const auto cost = factor.Cost();
    // Whitened residuals reach 1e5 and more, and carry their rounding along.
    ExpectJacobiansMatch(
        *cost,
        BlocksOf(factor),
        {nullptr, manifold, nullptr, nullptr, full.get(), nullptr, nullptr},
        4e-4,
        1e-8);
    ExpectBlocksCanBeLeftOut(*cost, BlocksOf(factor));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

}  // namespace
}  // namespace selfcal
