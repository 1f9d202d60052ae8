#include "core/factor/inertial.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/model/so3.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

struct Factor {
  std::vector<ImuSample> samples;
  KeyframeState x0, x1;
  ImuCalibration imu;
  ImuNoise noise;

  InertialResidual Evaluate(InertialJacobians* jacobians = nullptr,
                            InertialMatrix* covariance = nullptr) const {
    return EvaluateInertial(
        samples, x0, x1, imu, noise, kGravity, jacobians, covariance);
  }
};

// Random states, except that the rotation residual is Exp(error).
Factor RandomFactor(RandomValues& random,
                    const ImuCalibration& imu,
                    double rate_hz,
                    double duration_s,
                    const Vector3d& error) {
  Factor factor;
  factor.samples = random.Samples(rate_hz, duration_s);
  factor.imu = imu;
  factor.x0 = random.State(0);
  factor.x1 = random.State(static_cast<std::int64_t>(1e9 * duration_s));
  const Preintegration motion = Preintegrate(factor.samples,
                                             factor.x0.t_ns,
                                             factor.x1.t_ns,
                                             factor.imu,
                                             factor.x0.b_a,
                                             factor.x0.b_g,
                                             factor.noise);
  factor.x1.q_GI = (factor.x0.q_GI * motion.Delta_R * Exp(error)).normalized();
  return factor;
}

ImuCalibration MovedImu(const ImuCalibration& imu, const VectorXd& delta) {
  return BoxPlus(Calibration{.imu = imu, .cameras = {}}, delta).imu;
}

void ExpectJacobiansMatch(const Factor& factor) {
  // Large enough for the rounding of sums over a thousand samples, small enough
  // for the fifth derivative of a rotation over a second.
  constexpr double kStep = 2e-4;
  constexpr double kTolerance = 2e-9;
  InertialJacobians J;
  const InertialResidual residual = factor.Evaluate(&J);
  EXPECT_EQ(residual, factor.Evaluate());
  const auto numeric = [](const auto& evaluate, int size = 15) {
    return NumericJacobian(evaluate, size, kStep);
  };
  EXPECT_LT(RowwiseDifference(J.x0, numeric([&](const VectorXd& delta) {
                                Factor moved = factor;
                                moved.x0 = BoxPlus(factor.x0, delta);
                                return moved.Evaluate();
                              })),
            kTolerance);
  EXPECT_LT(RowwiseDifference(J.x1, numeric([&](const VectorXd& delta) {
                                Factor moved = factor;
                                moved.x1 = BoxPlus(factor.x1, delta);
                                return moved.Evaluate();
                              })),
            kTolerance);
  const auto by_theta = [&](const VectorXd& delta) {
    Factor moved = factor;
    moved.imu = MovedImu(factor.imu, delta);
    return moved.Evaluate();
  };
  EXPECT_LT(
      RowwiseDifference(J.theta, numeric(by_theta, ImuTangentSize(factor.imu))),
      kTolerance);
}

TEST(Inertial, JacobiansMatchDifferencesAtRandomStates) {
  RandomValues random(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3d error = random.Normal3(random.LogUniform(1e-6, 1));
    if (error.norm() > 3) continue;
    ExpectJacobiansMatch(RandomFactor(random,
                                      random.Imu(),
                                      random.LogUniform(100, 1000),
                                      random.Uniform(0.02, 0.1),
                                      error));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(Inertial, JacobiansOfACoupledImuMatchDifferences) {
  RandomValues random(21);
  for (int trial = 0; trial < 1000; ++trial) {
    ExpectJacobiansMatch(RandomFactor(random,
                                      random.CoupledImu(),
                                      random.LogUniform(100, 1000),
                                      random.Uniform(0.02, 0.1),
                                      random.Normal3(0.1)));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(Inertial, JacobiansMatchDifferencesOverASecond) {
  RandomValues random(2);
  for (int trial = 0; trial < 100; ++trial) {
    ExpectJacobiansMatch(RandomFactor(random,
                                      random.Imu(),
                                      random.LogUniform(100, 1000),
                                      1.0,
                                      random.Normal3(0.1)));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(Inertial, JacobiansMatchDifferencesWhereTheRotationResidualNearsPi) {
  RandomValues random(3);
  for (int trial = 0; trial < 1000; ++trial) {
    // The differences must not step over pi, where the residual jumps.
    const Vector3d error =
        (M_PI - random.LogUniform(2e-3, 0.3)) * random.Normal3(1).normalized();
    ExpectJacobiansMatch(RandomFactor(random, random.Imu(), 200, 0.1, error));
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(Inertial, ResidualVanishesOnATrueMotion) {
  RandomValues random(4);
  for (int trial = 0; trial < 100; ++trial) {
    const AnalyticMotion motion(random);
    Factor factor;
    factor.imu = random.Imu();
    factor.x0 = motion.State(0);
    factor.x1 = motion.State(100'000'000);
    factor.x0.b_a = factor.x1.b_a = random.Normal3(0.2);
    factor.x0.b_g = factor.x1.b_g = random.Normal3(0.02);
    // At 10 kHz the interpolation between samples no longer counts.
    factor.samples = motion.Readings(-30'000,
                                     factor.x1.t_ns,
                                     100'000,
                                     factor.imu,
                                     factor.x0.b_a,
                                     factor.x0.b_g,
                                     kGravity);
    EXPECT_LT(factor.Evaluate().cwiseAbs().maxCoeff(), 2e-7);
  }
}

TEST(Inertial, ResidualDoesNotChangeWhenYawAndPlaceOfBothStatesDo) {
  RandomValues random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const Factor factor =
        RandomFactor(random, random.Imu(), 200, 0.2, random.Normal3(0.5));
    const Eigen::Quaterniond yaw =
        Exp(Vector3d(0, 0, random.Uniform(-M_PI, M_PI)));
    const Vector3d shift = random.Normal3(100);
    Factor moved = factor;
    for (KeyframeState* x : {&moved.x0, &moved.x1}) {
      x->q_GI = yaw * x->q_GI;
      x->p_GI = yaw * x->p_GI + shift;
      x->v_GI = yaw * x->v_GI;
    }
    EXPECT_LT((moved.Evaluate() - factor.Evaluate()).cwiseAbs().maxCoeff(),
              1e-11);
  }
}

TEST(Inertial, BiasWalkGrowsWithTheSquareRootOfTime) {
  const ImuNoise noise = {.gyro_bias_random_walk = 2e-5,
                          .accel_bias_random_walk = 3e-3};
  const Eigen::Matrix<double, 6, 1> sigmas = BiasWalkSigmas(noise, 4);
  for (int i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(sigmas[i], 6e-3);
    EXPECT_DOUBLE_EQ(sigmas[3 + i], 4e-5);
  }
}

TEST(Inertial, CovarianceOfTheBiasesIsThatOfTheirWalkAlone) {
  RandomValues random(6);
  const Factor factor =
      RandomFactor(random, random.Imu(), 200, 0.5, Vector3d::Zero());
  InertialMatrix covariance;
  factor.Evaluate(nullptr, &covariance);
  const Eigen::MatrixXd variances =
      BiasWalkSigmas(factor.noise, 0.5).cwiseAbs2().asDiagonal();
  EXPECT_LT((covariance.bottomRightCorner<6, 6>() - variances).norm(), 1e-15);
}

// The residual responds to an error of the preintegrated rotation as the
// covariance assumes, also where the residual is large.
TEST(Inertial, CovarianceCarriesTheRotationNoiseThroughLog) {
  RandomValues random(7);
  for (int trial = 0; trial < 200; ++trial) {
    const Factor factor =
        RandomFactor(random,
                     random.Imu(),
                     200,
                     0.1,
                     random.Uniform(0, 3) * random.Normal3(1).normalized());
    InertialMatrix covariance;
    const InertialResidual residual = factor.Evaluate(nullptr, &covariance);
    const Preintegration motion = Preintegrate(factor.samples,
                                               factor.x0.t_ns,
                                               factor.x1.t_ns,
                                               factor.imu,
                                               factor.x0.b_a,
                                               factor.x0.b_g,
                                               factor.noise);
    const Eigen::Quaterniond q_01 = factor.x0.q_GI.conjugate() * factor.x1.q_GI;
    const Eigen::MatrixXd by_nine = NumericJacobian(
        [&](const VectorXd& delta) -> VectorXd {
          VectorXd r = residual.head<9>();
          r.head<3>() =
              Log((motion.Delta_R * Exp(delta.head<3>())).conjugate() * q_01);
          r.tail<6>() -= delta.tail<6>();
          return r;
        },
        9,
        1e-4);
    Eigen::MatrixXd by_fifteen = Eigen::MatrixXd::Identity(15, 15);
    by_fifteen.topLeftCorner<9, 9>() = by_nine;
    Eigen::MatrixXd of_fifteen = covariance;
    of_fifteen.topLeftCorner<9, 9>() = motion.covariance;
    of_fifteen.topRightCorner<9, 6>() = motion.covariance_with_walk;
    of_fifteen.bottomLeftCorner<6, 9>() =
        motion.covariance_with_walk.transpose();
    const Eigen::MatrixXd expected =
        by_fifteen * of_fifteen * by_fifteen.transpose();
    const VectorXd scale = expected.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd difference =
        scale.asDiagonal() * (covariance - expected) * scale.asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(SquareRootInformation, WhitensTheCovarianceItCameFrom) {
  RandomValues random(8);
  for (int trial = 0; trial < 1000; ++trial) {
    Factor factor = RandomFactor(random,
                                 random.Imu(),
                                 random.LogUniform(100, 1000),
                                 random.LogUniform(1e-3, 1),
                                 random.Normal3(0.1));
    factor.noise = {.gyro_noise_density = random.LogUniform(1e-5, 1e-2),
                    .accel_noise_density = random.LogUniform(1e-4, 1e-1),
                    .gyro_bias_random_walk = random.LogUniform(1e-7, 1e-2),
                    .accel_bias_random_walk = random.LogUniform(1e-6, 1e-1)};
    InertialMatrix covariance;
    factor.Evaluate(nullptr, &covariance);
    const InertialMatrix W = SquareRootInformation(covariance);
    EXPECT_TRUE(W.isUpperTriangular(0));
    EXPECT_LT((W * covariance * W.transpose() - InertialMatrix::Identity())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-9);
  }
}

TEST(SquareRootInformation, IsFiniteForAnyPositiveNoise) {
  RandomValues random(9);
  for (int trial = 0; trial < 2000; ++trial) {
    Factor factor = RandomFactor(random,
                                 random.Imu(),
                                 random.LogUniform(10, 1000),
                                 random.LogUniform(1e-8, 1),
                                 random.Normal3(0.1));
    factor.noise = {.gyro_noise_density = random.LogUniform(1e-12, 1e6),
                    .accel_noise_density = random.LogUniform(1e-12, 1e6),
                    .gyro_bias_random_walk = random.LogUniform(1e-12, 1e6),
                    .accel_bias_random_walk = random.LogUniform(1e-12, 1e6)};
    InertialMatrix covariance;
    factor.Evaluate(nullptr, &covariance);
    EXPECT_TRUE(SquareRootInformation(covariance).allFinite());
  }
}

TEST(SquareRootInformation, IsFiniteForASingularCovariance) {
  // Correlation one between every two components.
  const InertialResidual sigmas =
      InertialResidual::LinSpaced(-6, 2).array().exp();
  const InertialMatrix W = SquareRootInformation(sigmas * sigmas.transpose());
  EXPECT_TRUE(W.allFinite());
  EXPECT_GT(W.diagonal().minCoeff(), 0);
}

}  // namespace
}  // namespace selfcal
