#include <gtest/gtest.h>

#include "core/factor/ceres_factors.h"
#include "core/model/second_imu.h"
#include "core/model/so3.h"
#include "test/core/factor/cost_function_checks.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

struct Factor {
  Calibration reference;
  int imu = 0;
  VectorXd delta;  // of theta, from the reference
  std::vector<ImuSample> samples;
  ImuNoise noise;
  KeyframeState x0, x1;
  InertialMatrix W;

  std::unique_ptr<ceres::CostFunction> Cost() const {
    return MakeInertialCost(
        reference, imu, samples, x0.t_ns, x1.t_ns, noise, kGravity, W);
  }
  InertialResidual Plain(InertialMatrix* covariance) const {
    const Calibration theta = BoxPlus(reference, delta);
    return EvaluateInertial(samples,
                            StateOfImu(theta, imu, x0),
                            StateOfImu(theta, imu, x1),
                            ImuOf(theta, imu),
                            noise,
                            kGravity,
                            nullptr,
                            covariance);
  }
};

VectorXd VelocityAndBiases(const KeyframeState& x, int imu) {
  VectorXd vb(9);
  if (imu == 0) {
    vb << x.v_GI, x.b_a, x.b_g;
  } else {
    vb << x.v_GJ, x.b_a1, x.b_g1;
  }
  return vb;
}

Blocks BlocksOf(const Factor& factor) {
  return {factor.delta,
          factor.x0.q_GI.coeffs(),
          factor.x0.p_GI,
          VelocityAndBiases(factor.x0, factor.imu),
          factor.x1.q_GI.coeffs(),
          factor.x1.p_GI,
          VelocityAndBiases(factor.x1, factor.imu)};
}

// A factor of the first IMU; with a second one, of that.
Factor RandomFactor(RandomValues& random,
                    double duration_s,
                    bool coupled,
                    bool second = false) {
  Factor factor;
  factor.reference.imu = coupled ? random.CoupledImu() : random.Imu();
  if (second) {
    factor.imu = 1;
    factor.reference.imu1 = random.SecondImu(coupled);
  }
  factor.reference.cameras = {random.Camera(DistortionModel::kFov),
                              random.Camera(DistortionModel::kEquidistant)};
  factor.delta = 0.02 * random.NormalVector(TangentSize(factor.reference));
  // Optional blocks: of the size of their values.
  const int size = ImuTangentSize(factor.reference.imu);
  for (int first = 0; first <= factor.imu * size; first += size) {
    factor.delta.segment(first + kImuTangentSize, size - kImuTangentSize) *=
        0.1;
    factor.delta.segment<3>(first + kAccelRotation) = random.Normal3(0.7);
  }
  // A few milliseconds of the time offset.
  if (second) factor.delta[LinkTangentSize(factor.reference) - 1] *= 0.1;
  factor.samples = random.Samples(random.LogUniform(100, 1000), duration_s);
  factor.x0 = random.State(0);
  factor.x1 = random.State(static_cast<std::int64_t>(1e9 * duration_s));
  if (second) {
    for (KeyframeState* x : {&factor.x0, &factor.x1}) {
      x->v_GJ = random.Normal3(2);
      x->b_a1 = random.Normal3(0.2);
      x->b_g1 = random.Normal3(0.02);
    }
  }
  // Rotations that agree to within a radian, away from the jump at pi.
  const Calibration& theta = factor.reference;
  const KeyframeState y0 = StateOfImu(theta, factor.imu, factor.x0);
  const Preintegration motion = Preintegrate(factor.samples,
                                             factor.x0.t_ns,
                                             factor.x1.t_ns,
                                             ImuOf(theta, factor.imu),
                                             y0.b_a,
                                             y0.b_g,
                                             factor.noise);
  Eigen::Quaterniond turn = motion.Delta_R;
  if (second) turn = theta.imu1->q_JI.conjugate() * turn * theta.imu1->q_JI;
  factor.x1.q_GI = factor.x0.q_GI * turn *
                   Exp(random.Uniform(0, 1) * random.Normal3(1).normalized());
  InertialMatrix covariance;
  factor.Plain(&covariance);
  factor.W = SquareRootInformation(covariance);
  return factor;
}

TEST(InertialCost, IsThePlainFactorWhitened) {
  RandomValues random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const Factor factor =
        RandomFactor(random, 0.1, trial % 2 == 1, trial % 4 > 1);
    const VectorXd expected = factor.W * factor.Plain(nullptr);
    const VectorXd residuals =
        EvaluateCost(*factor.Cost(), BlocksOf(factor), false).residuals;
    EXPECT_LT((residuals - expected).norm(), 1e-10 * expected.norm());
  }
}

// Random readings have corners, so that differences by the time offset of a
// second IMU are not its derivatives (imu_delay_test.cc tests these).
std::unique_ptr<ceres::Manifold> WithoutTimeOffset(const Factor& factor) {
  if (factor.imu == 0) return nullptr;
  const int size = static_cast<int>(factor.delta.size());
  return std::make_unique<ceres::SubsetManifold>(
      size, std::vector<int>{LinkTangentSize(factor.reference) - 1});
}

TEST(InertialCost, JacobiansMatchDifferencesThroughBothManifolds) {
  RandomValues random(2);
  const auto full = MakeRotationManifold();
  const auto gauge = MakeGaugeRotationManifold();
  for (int trial = 0; trial < 300; ++trial) {
    const Factor factor = RandomFactor(
        random, trial % 20 == 0 ? 1 : 0.1, trial % 3 == 0, trial % 4 > 1);
    const auto* manifold = trial % 2 == 0 ? full.get() : gauge.get();
    const auto cost = factor.Cost();
    const auto smooth = WithoutTimeOffset(factor);
    // Whitened residuals reach 1e5 and more, and carry their rounding along.
    ExpectJacobiansMatch(*cost,
                         BlocksOf(factor),
                         {smooth.get(),
                          manifold,
                          nullptr,
                          nullptr,
                          full.get(),
                          nullptr,
                          nullptr},
                         4e-4,
                         1e-8);
    ExpectBlocksCanBeLeftOut(*cost, BlocksOf(factor));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

}  // namespace
}  // namespace selfcal
