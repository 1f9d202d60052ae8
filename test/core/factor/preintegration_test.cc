#include "core/factor/preintegration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/factor/inertial.h"
#include "core/model/so3.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/gravity.h"
#include "test/core/factor/random_values.h"
#include "test/core/numeric_jacobian.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector9d = Eigen::Matrix<double, 9, 1>;

// The difference of two motions in the tangent order of the nine.
Vector9d Difference(const Preintegration& a, const Preintegration& b) {
  Vector9d difference;
  difference << Log(b.Delta_R.conjugate() * a.Delta_R), a.Delta_v - b.Delta_v,
      a.Delta_p - b.Delta_p;
  return difference;
}

struct Integral {
  std::vector<ImuSample> samples;
  std::int64_t t1_ns = 0;
  ImuCalibration imu;
  Vector3d b_a = Vector3d::Zero();
  Vector3d b_g = Vector3d::Zero();
  ImuNoise noise;

  Preintegration From(std::int64_t t0_ns, std::int64_t end_ns) const {
    return Preintegrate(samples, t0_ns, end_ns, imu, b_a, b_g, noise);
  }
  Preintegration Whole() const { return From(0, t1_ns); }
  Preintegration MotionAlone() const {
    return Preintegrate(
        samples, 0, t1_ns, imu, b_a, b_g, noise, {false, false});
  }
};

Integral RandomIntegral(RandomValues& random,
                        double rate_hz,
                        double duration_s) {
  return {.samples = random.Samples(rate_hz, duration_s),
          .t1_ns = static_cast<std::int64_t>(1e9 * duration_s),
          .imu = random.Imu(),
          .b_a = random.Normal3(0.2),
          .b_g = random.Normal3(0.02),
          .noise = {}};
}

// The motion between two states.
Preintegration TrueMotion(const KeyframeState& x0, const KeyframeState& x1) {
  const double dt = 1e-9 * static_cast<double>(x1.t_ns - x0.t_ns);
  const Vector3d g(0, 0, -kGravity);
  const Eigen::Quaterniond q_IG = x0.q_GI.conjugate();
  Preintegration motion;
  motion.dt_s = dt;
  motion.Delta_R = q_IG * x1.q_GI;
  motion.Delta_v = q_IG * (x1.v_GI - x0.v_GI - dt * g);
  motion.Delta_p =
      q_IG * (x1.p_GI - x0.p_GI - dt * x0.v_GI - 0.5 * dt * dt * g);
  return motion;
}

// Ideal readings of a motion, every period_ns from before 0.
Integral OnMotion(const AnalyticMotion& motion,
                  const ImuCalibration& imu,
                  RandomValues& random,
                  std::int64_t period_ns,
                  std::int64_t t1_ns) {
  Integral integral{.samples = {},
                    .t1_ns = t1_ns,
                    .imu = imu,
                    .b_a = random.Normal3(0.2),
                    .b_g = random.Normal3(0.02),
                    .noise = {}};
  integral.samples = motion.Readings(-period_ns / 3,
                                     t1_ns,
                                     period_ns,
                                     integral.imu,
                                     integral.b_a,
                                     integral.b_g,
                                     kGravity);
  return integral;
}

TEST(Preintegrate, OnASmoothMotionTheErrorIsOfThirdOrder) {
  RandomValues random(1);
  const std::int64_t t1_ns = 400'000'000;
  Vector9d coarse = Vector9d::Zero();
  Vector9d fine = Vector9d::Zero();
  for (int trial = 0; trial < 100; ++trial) {
    const AnalyticMotion motion(random);
    const Preintegration truth =
        TrueMotion(motion.State(0), motion.State(t1_ns));
    const auto error = [&](std::int64_t period_ns) -> Vector9d {
      return Difference(OnMotion(motion, random.Imu(), random, period_ns, t1_ns)
                            .Whole(),
                        truth)
          .array()
          .square();
    };
    coarse += error(10'000'000);
    fine += error(2'500'000);
  }
  // A fourth of the period: the error falls to a 64th.
  for (int i = 0; i < 9; ++i) {
    EXPECT_NEAR(std::log(coarse[i] / fine[i]) / 2 / std::log(4), 3, 0.1)
        << "component " << i;
  }
}

TEST(Preintegrate, OnHandShakenMotionTheErrorIsBelowTheNoise) {
  RandomValues random(2);
  const std::int64_t t1_ns = 100'000'000;
  const int trials = 1000;
  Vector9d sum = Vector9d::Zero();
  for (int trial = 0; trial < trials; ++trial) {
    const AnalyticMotion motion(random);
    const Preintegration measured =
        OnMotion(motion, random.Imu(), random, 5'000'000, t1_ns).Whole();
    const Vector9d error =
        Difference(measured, TrueMotion(motion.State(0), motion.State(t1_ns)));
    sum += error.cwiseAbs2().cwiseQuotient(measured.covariance.diagonal());
  }
  // In sigmas of the default noise. The remaining error is the interpolation
  // between samples, largest for the rotation: the gyroscope is the better
  // sensor.
  const Vector9d rms = (sum / trials).cwiseSqrt();
  EXPECT_LT(rms.head<3>().maxCoeff(), 0.002);
  EXPECT_LT(rms.tail<6>().maxCoeff(), 0.001);
}

// The velocity of the accelerometer relative to the origin depends on the rate
// at the ends, which is interpolated.
TEST(Preintegrate, OfACoupledImuTheErrorIsOfSecondOrder) {
  RandomValues random(11);
  const std::int64_t t1_ns = 400'000'000;
  Vector9d coarse = Vector9d::Zero();
  Vector9d fine = Vector9d::Zero();
  for (int trial = 0; trial < 100; ++trial) {
    const AnalyticMotion motion(random);
    const ImuCalibration imu = random.CoupledImu();
    const Preintegration truth =
        TrueMotion(motion.State(0), motion.State(t1_ns));
    const auto error = [&](std::int64_t period_ns) -> Vector9d {
      return Difference(OnMotion(motion, imu, random, period_ns, t1_ns).Whole(),
                        truth)
          .array()
          .square();
    };
    coarse += error(10'000'000);
    fine += error(2'500'000);
  }
  const Vector9d order =
      (coarse.array() / fine.array()).log() / 2 / std::log(4);
  EXPECT_GT(order.head<3>().minCoeff(), 2.9);
  EXPECT_NEAR(order.segment<3>(3).mean(), 2, 0.1);
  EXPECT_GT(order.tail<3>().minCoeff(), 1.9);
}

TEST(Preintegrate, OfACoupledImuTheErrorOnHandShakenMotionIsBelowTheNoise) {
  RandomValues random(12);
  const std::int64_t t1_ns = 100'000'000;
  const int trials = 1000;
  Vector9d sum = Vector9d::Zero();
  for (int trial = 0; trial < trials; ++trial) {
    const AnalyticMotion motion(random);
    const Preintegration measured =
        OnMotion(motion, random.CoupledImu(), random, 5'000'000, t1_ns).Whole();
    const Vector9d error =
        Difference(measured, TrueMotion(motion.State(0), motion.State(t1_ns)));
    sum += error.cwiseAbs2().cwiseQuotient(measured.covariance.diagonal());
  }
  // Positions are those of 5 cm on each axis.
  const Vector9d rms = (sum / trials).cwiseSqrt();
  EXPECT_LT(rms.head<3>().maxCoeff(), 0.002);
  EXPECT_LT(rms.tail<6>().maxCoeff(), 0.05);
}

TEST(Preintegrate, OnLinearReadingsTheErrorIsOfFourthOrder) {
  RandomValues random(3);
  Vector9d coarse = Vector9d::Zero();
  Vector9d fine = Vector9d::Zero();
  for (int trial = 0; trial < 100; ++trial) {
    const Vector3d w0 = random.Normal3(2), w1 = random.Normal3(2);
    const Vector3d f0 = random.Normal3(10), f1 = random.Normal3(10);
    const auto motion = [&](int steps) {
      Integral integral;
      integral.t1_ns = 640'000'000;
      for (int i = 0; i <= steps; ++i) {
        const double part = static_cast<double>(i) / steps;
        integral.samples.push_back({integral.t1_ns / steps * i,
                                    w0 + part * (w1 - w0),
                                    f0 + part * (f1 - f0)});
      }
      return integral.Whole();
    };
    const Preintegration truth = motion(1000);
    coarse += Difference(motion(8), truth).cwiseAbs2();
    fine += Difference(motion(32), truth).cwiseAbs2();
  }
  for (int i = 0; i < 9; ++i) {
    EXPECT_NEAR(std::log(coarse[i] / fine[i]) / 2 / std::log(4), 4, 0.2)
        << "component " << i;
  }
}

TEST(Preintegrate, JacobiansMatchDifferencesOfTheScheme) {
  RandomValues random(4);
  for (int trial = 0; trial < 2000; ++trial) {
    Integral integral = RandomIntegral(
        random, random.LogUniform(100, 1000), random.Uniform(0.02, 0.3));
    if (trial >= 1000) integral.imu = random.CoupledImu();
    const Preintegration motion = integral.Whole();
    const auto by_bias = [&](const VectorXd& delta) -> VectorXd {
      Integral moved = integral;
      moved.b_a += delta.head<3>();
      moved.b_g += delta.tail<3>();
      return Difference(moved.MotionAlone(), motion);
    };
    const auto by_theta = [&](const VectorXd& delta) -> VectorXd {
      Integral moved = integral;
      moved.imu =
          BoxPlus(Calibration{.imu = integral.imu, .cameras = {}}, delta).imu;
      return Difference(moved.MotionAlone(), motion);
    };
    EXPECT_LT(
        RowwiseDifference(motion.J_bias, NumericJacobian(by_bias, 6, 2e-4)),
        1e-9);
    EXPECT_LT(
        RowwiseDifference(
            motion.J_theta,
            NumericJacobian(by_theta, ImuTangentSize(integral.imu), 2e-4)),
        1e-9);
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(Preintegrate, WhereSamplesAreMissingReadingsStayLinear) {
  // A parabola, with a gap between 0.04 s and 0.1 s. Steps near it differ too
  // much for a second difference; the others are integrated exactly.
  Integral integral;
  for (const double t : {-0.02, 0.0, 0.02, 0.04, 0.1, 0.12, 0.14}) {
    integral.samples.push_back(
        {std::llround(1e9 * t), Vector3d::Zero(), Vector3d(300 * t * t, 0, 0)});
  }
  EXPECT_NEAR(integral.From(0, 20'000'000).Delta_v.x(), 100 * 8e-6, 1e-15);
  EXPECT_NEAR(integral.From(120'000'000, 140'000'000).Delta_v.x(),
              100 * (2.744e-3 - 1.728e-3),
              1e-15);
  const double trapezoid = 0.06 / 2 * 300 * (0.04 * 0.04 + 0.1 * 0.1);
  EXPECT_NEAR(
      integral.From(40'000'000, 100'000'000).Delta_v.x(), trapezoid, 1e-15);
}

TEST(Preintegrate, SplitAtASampleTheTwoPartsComposeToTheWhole) {
  RandomValues random(5);
  for (int trial = 0; trial < 200; ++trial) {
    Integral integral = RandomIntegral(random, 200, 0.2);
    integral.noise.gyro_bias_random_walk = 0;
    integral.noise.accel_bias_random_walk = 0;
    const std::int64_t split_ns = integral.samples[20].t_ns;
    const Preintegration a = integral.From(0, split_ns);
    const Preintegration b = integral.From(split_ns, integral.t1_ns);
    const Preintegration whole = integral.Whole();

    Preintegration both;
    both.dt_s = a.dt_s + b.dt_s;
    both.Delta_R = a.Delta_R * b.Delta_R;
    both.Delta_v = a.Delta_v + a.Delta_R * b.Delta_v;
    both.Delta_p = a.Delta_p + b.dt_s * a.Delta_v + a.Delta_R * b.Delta_p;
    EXPECT_NEAR(both.dt_s, whole.dt_s, 1e-15);
    EXPECT_LT(Difference(both, whole).norm(), 1e-12);

    // Right perturbations of both parts carried to the end.
    using Matrix9d = Eigen::Matrix<double, 9, 9>;
    const Eigen::Matrix3d R_a = a.Delta_R.toRotationMatrix();
    Matrix9d by_a = Matrix9d::Identity();
    by_a.topLeftCorner<3, 3>() = b.Delta_R.toRotationMatrix().transpose();
    by_a.block<3, 3>(3, 0) = -R_a * Skew(b.Delta_v);
    by_a.block<3, 3>(6, 0) = -R_a * Skew(b.Delta_p);
    by_a.block<3, 3>(6, 3).diagonal().setConstant(b.dt_s);
    Matrix9d by_b = Matrix9d::Identity();
    by_b.block<3, 3>(3, 3) = by_b.block<3, 3>(6, 6) = R_a;

    const Matrix9d covariance = by_a * a.covariance * by_a.transpose() +
                                by_b * b.covariance * by_b.transpose();
    EXPECT_LT((covariance - whole.covariance).norm(),
              1e-12 * whole.covariance.norm());

    // For walks alone: the biases of the second part begin where those of the
    // first have walked to. Random readings are not a constant rotation and
    // force, and the pieces in which the walk is computed differ.
    integral.noise = {.gyro_noise_density = 0, .accel_noise_density = 0};
    const Preintegration walk_a = integral.From(0, split_ns);
    const Preintegration walk_b = integral.From(split_ns, integral.t1_ns);
    const Preintegration walk_whole = integral.Whole();
    const Eigen::MatrixXd begin_b = -by_b * b.J_bias;
    const Eigen::MatrixXd begun =
        BiasWalkSigmas(integral.noise, a.dt_s).cwiseAbs2().asDiagonal();
    const Eigen::MatrixXd together =
        by_a * walk_a.covariance_with_walk * begin_b.transpose();
    const Matrix9d walked = by_a * walk_a.covariance * by_a.transpose() +
                            by_b * walk_b.covariance * by_b.transpose() +
                            begin_b * begun * begin_b.transpose() + together +
                            together.transpose();
    EXPECT_LT((walked - walk_whole.covariance).norm(),
              0.03 * walk_whole.covariance.norm());
    const Eigen::MatrixXd with_walk = by_a * walk_a.covariance_with_walk +
                                      begin_b * begun +
                                      by_b * walk_b.covariance_with_walk;
    EXPECT_LT((with_walk - walk_whole.covariance_with_walk).norm(),
              0.03 * walk_whole.covariance_with_walk.norm());

    EXPECT_LT((by_a * a.J_theta + by_b * b.J_theta - whole.J_theta).norm(),
              1e-12 * whole.J_theta.norm());
    EXPECT_LT((by_a * a.J_bias + by_b * b.J_bias - whole.J_bias).norm(),
              1e-12 * whole.J_bias.norm());
  }
}

TEST(Preintegrate, EndPointsBetweenSamplesAreInterpolated) {
  // An accelerometer reading that grows linearly integrates exactly.
  Integral integral;
  integral.samples = {{0, Vector3d::Zero(), Vector3d(0, 0, 0)},
                      {100'000'000, Vector3d::Zero(), Vector3d(1, 0, 0)},
                      {200'000'000, Vector3d::Zero(), Vector3d(2, 0, 0)}};
  // a = 10 t from 0.03 s to 0.17 s.
  const Preintegration motion = integral.From(30'000'000, 170'000'000);
  EXPECT_NEAR(motion.dt_s, 0.14, 1e-15);
  EXPECT_NEAR(motion.Delta_v.x(), 5 * (0.17 * 0.17 - 0.03 * 0.03), 1e-14);
  const double dt = 0.14;
  EXPECT_NEAR(
      motion.Delta_p.x(), 0.3 * dt * dt / 2 + 10 * dt * dt * dt / 6, 1e-14);
}

TEST(Preintegrate, ASampleOnAnEndPointGivesNoStepOfLengthZero) {
  RandomValues random(6);
  const Integral integral = RandomIntegral(random, 200, 0.1);
  const std::int64_t t0_ns = integral.samples[3].t_ns;
  const std::int64_t t1_ns = integral.samples[12].t_ns;
  const Preintegration exact = integral.From(t0_ns, t1_ns);
  EXPECT_TRUE(exact.covariance.allFinite());
  // One nanosecond to either side adds tiny steps, and changes nothing.
  const Preintegration wider = integral.From(t0_ns - 1, t1_ns + 1);
  EXPECT_TRUE(wider.covariance.allFinite());
  EXPECT_LT(Difference(exact, wider).norm(), 1e-6);
  EXPECT_LT((exact.covariance - wider.covariance).norm(),
            1e-5 * exact.covariance.norm());
  EXPECT_LT((exact.J_theta - wider.J_theta).norm(), 1e-6);
}

TEST(Preintegrate, AnEmptyIntervalIsNoMotion) {
  RandomValues random(7);
  const Integral integral = RandomIntegral(random, 200, 0.1);
  const Preintegration motion = integral.From(50'000'000, 50'000'000);
  EXPECT_EQ(motion.dt_s, 0);
  EXPECT_EQ(Difference(motion, Preintegration{}).norm(), 0);
  EXPECT_EQ(motion.covariance.norm(), 0);
  EXPECT_EQ(motion.J_theta.norm(), 0);
}

TEST(Preintegrate, OmittedPartsStayZeroAndChangeNothingElse) {
  RandomValues random(8);
  const Integral integral = RandomIntegral(random, 200, 0.1);
  const Preintegration all = integral.Whole();
  const Preintegration motion = integral.MotionAlone();
  // Two instances of one template: with fused multiply-add, a compiler may fuse
  // differently in each, which is 1.1e-18 on arm64.
  EXPECT_LT(Difference(motion, all).norm(), 1e-15);
  EXPECT_EQ(motion.J_bias.norm() + motion.J_theta.norm(), 0);
  EXPECT_EQ(motion.covariance.norm(), 0);
}

}  // namespace
}  // namespace selfcal
