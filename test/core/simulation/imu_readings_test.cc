#include "core/simulation/imu_readings.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/model/imu.h"

namespace selfcal {
namespace {

TEST(ImuReadingsTest, WithoutNoiseFollowTheSensorModel) {
  const Rig rig = HandheldRig("a");
  const auto trajectory = MakeHandheld(5, 1, 3);
  SimulationOptions options;
  options.noise = false;
  const ImuReadings imu =
      SimulateImu(rig, rig.factory.imu, *trajectory, options);
  ASSERT_EQ(imu.measured.size(), 1001u);
  for (std::size_t i = 0; i < imu.measured.size(); ++i) {
    const ImuSample& sample = imu.measured[i];
    EXPECT_EQ(sample.t_ns, static_cast<std::int64_t>(i) * 5'000'000);
    const BodyMotion motion =
        trajectory->At(static_cast<double>(sample.t_ns) * 1e-9);
    const Eigen::Vector3d f_I =
        motion.q_GI.conjugate() *
        (motion.a_GI + Eigen::Vector3d(0, 0, rig.gravity_mps2));
    const ImuCalibration& theta = rig.factory.imu;
    const Eigen::Vector3d gyro = theta.T_g() * motion.w_I + options.b_g0;
    const Eigen::Vector3d accel =
        theta.T_a() * (theta.q_AI * f_I) + options.b_a0;
    EXPECT_LT((sample.gyro - gyro).norm(), 1e-12);
    EXPECT_LT((sample.accel - accel).norm(), 1e-12);
  }
}

TEST(ImuReadingsTest, OfSensorsThatAreCoupledGiveTheMotionBack) {
  Rig rig = HandheldRig("a");
  ImuCalibration& theta = rig.factory.imu;
  theta.gyro_g_sensitivity.resize(9);
  theta.gyro_g_sensitivity << 5, -3, 2, 1, 4, -2, 3, 2, -6;
  theta.gyro_g_sensitivity *= 1e-4;
  theta.accel_position.resize(9);
  theta.accel_position << 0.02, 0.01, -0.03, 0.03, 0, 0.01, -0.01, 0.02, 0.02;
  const auto trajectory = MakeHandheld(5, 1, 3);
  SimulationOptions options;
  options.noise = false;
  const ImuReadings imu = SimulateImu(rig, theta, *trajectory, options);
  for (std::size_t i = 0; i < imu.measured.size(); ++i) {
    const ImuSample& sample = imu.measured[i];
    const BodyMotion motion =
        trajectory->At(static_cast<double>(sample.t_ns) * 1e-9);
    const BodyRates rates = CorrectImu(
        theta, sample.gyro, sample.accel, imu.b_g[i], imu.b_a[i], motion.dw_I);
    EXPECT_LT((rates.w_I - imu.w_I[i]).norm(), 1e-12);
    EXPECT_LT((rates.f_I - imu.f_I[i]).norm(), 1e-11);
  }
}

TEST(ImuReadingsTest, NoiseHasTheDensityOfTheRigAtAnyRate) {
  const Rig rig = HandheldRig("a");
  for (const double rate_hz : {100.0, 400.0}) {
    SimulationOptions options;
    options.imu_rate_hz = rate_hz;
    const ImuReadings imu =
        SimulateImu(rig, rig.factory.imu, *MakeRest(300), options);
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
    Eigen::Vector3d accel = Eigen::Vector3d::Zero();
    const auto n = static_cast<double>(imu.measured.size());
    for (std::size_t i = 0; i < imu.measured.size(); ++i) {
      gyro += (imu.measured[i].gyro - imu.noise_free[i].gyro).cwiseAbs2() / n;
      accel +=
          (imu.measured[i].accel - imu.noise_free[i].accel).cwiseAbs2() / n;
    }
    // Five standard deviations of a sample variance.
    const double bound = 5 * std::sqrt(2 / n);
    const ImuNoise& noise = rig.imu_noise;
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(
          gyro[i] / std::pow(noise.gyro_noise_density, 2) / rate_hz, 1, bound);
      EXPECT_NEAR(accel[i] / std::pow(noise.accel_noise_density, 2) / rate_hz,
                  1,
                  bound);
    }
  }
}

TEST(ImuReadingsTest, BiasesWalkAsFarAsTheDensityOfTheRigSays) {
  const Rig rig = HandheldRig("a");
  const ImuReadings imu =
      SimulateImu(rig, rig.factory.imu, *MakeRest(2000), {});
  // Steps over 1 s are independent, their variance is density^2 * 1 s.
  double b_a = 0;
  double b_g = 0;
  double n = 0;
  for (std::size_t i = 0; i + 200 < imu.b_a.size(); i += 200, n += 3) {
    b_a += (imu.b_a[i + 200] - imu.b_a[i]).squaredNorm();
    b_g += (imu.b_g[i + 200] - imu.b_g[i]).squaredNorm();
  }
  const double bound = 5 * std::sqrt(2 / n);
  EXPECT_NEAR(
      b_a / n / std::pow(rig.imu_noise.accel_bias_random_walk, 2), 1, bound);
  EXPECT_NEAR(
      b_g / n / std::pow(rig.imu_noise.gyro_bias_random_walk, 2), 1, bound);
}

TEST(ImuReadingsTest, FindsTheSampleBeforeATime) {
  std::vector<ImuSample> samples(3);
  samples[1].t_ns = 10;
  samples[2].t_ns = 20;
  EXPECT_EQ(SampleBefore(samples, 0), 0u);
  EXPECT_EQ(SampleBefore(samples, 9), 0u);
  EXPECT_EQ(SampleBefore(samples, 10), 1u);
  EXPECT_EQ(SampleBefore(samples, 25), 2u);
}

TEST(ImuReadingsTest, TheTrueStateIsOnTheTrajectoryWithInterpolatedBiases) {
  const Rig rig = HandheldRig("a");
  const auto trajectory = MakeHandheld(2, 1, 1);
  const ImuReadings imu = SimulateImu(rig, rig.factory.imu, *trajectory, {});
  const KeyframeState state = TrueState(*trajectory, imu, 101'250'000);
  EXPECT_EQ(state.t_ns, 101'250'000);
  EXPECT_EQ(state.v_GI, trajectory->At(0.10125).v_GI);
  EXPECT_LT((state.b_a - (0.75 * imu.b_a[20] + 0.25 * imu.b_a[21])).norm(),
            1e-15);
  EXPECT_LT((state.b_g - (0.75 * imu.b_g[20] + 0.25 * imu.b_g[21])).norm(),
            1e-15);
}

}  // namespace
}  // namespace selfcal
