#include "core/initialisation/gyro_rotation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/model/so3.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

ImuSample SampleAt(double t_s, const Eigen::Vector3d& gyro) {
  ImuSample sample;
  sample.t_ns = std::llround(t_s * 1e9);
  sample.gyro = gyro;
  return sample;
}

double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return Log(a.conjugate() * b).norm();
}

TEST(GyroRotation, IntegratesAConstantRateAlsoBeyondTheSamples) {
  const Eigen::Vector3d w(0.5, -1, 2);
  const Eigen::Vector3d b(0.01, 0.02, -0.03);
  ImuCalibration imu;
  imu.s_g = {1.1, 0.9, 1.05};
  imu.m_g = {0.01, 0.02, -0.01};
  GyroRotation rotation(imu, b);
  for (int i = 0; i <= 20; ++i) {
    rotation.Add(SampleAt(0.005 * i, imu.T_g() * w + b));
  }
  const double times[][2] = {{0.01, 0.09},
                             {0.09, 0.01},
                             {0.0123, 0.0771},
                             {-0.02, 0.05},
                             {0.02, 0.12}};
  for (const auto& [from_s, to_s] : times) {
    EXPECT_LT(
        AngleBetween(rotation.Between(from_s, to_s), Exp(w * (to_s - from_s))),
        1e-9);
  }
}

TEST(GyroRotation, FollowsTheRotationOfATrajectory) {
  const Rig rig = HandheldRig("x");
  const auto trajectory = MakeHandheld(5, 1, 3);
  SimulationOptions options;
  options.noise = false;
  options.b_g0.setZero();
  const ImuReadings readings =
      SimulateImu(rig, rig.factory.imu, *trajectory, options);
  GyroRotation rotation(rig.factory.imu);
  for (const ImuSample& sample : readings.measured) rotation.Add(sample);
  for (double t_s = 0.1; t_s < 4.8; t_s += 0.137) {
    const Eigen::Quaterniond expected =
        trajectory->At(t_s).q_GI.conjugate() * trajectory->At(t_s + 0.05).q_GI;
    // A hundredth of a pixel at 255 px/rad.
    EXPECT_LT(AngleBetween(rotation.Between(t_s, t_s + 0.05), expected), 4e-5);
  }
}

TEST(GyroRotation, DerivativeByTheBiasIsThatOfDifferences) {
  ImuCalibration imu;
  imu.s_g = {1.1, 0.9, 1.05};
  imu.m_g = {0.01, 0.02, -0.01};
  const auto with_bias = [&](const Eigen::Vector3d& b_g) {
    GyroRotation rotation(imu, b_g);
    for (int i = 0; i < 100; ++i) {
      rotation.Add(SampleAt(
          0.005 * i, {2 * std::sin(0.2 * i), 1 + std::cos(0.1 * i), 0.03 * i}));
    }
    return rotation;
  };
  const Eigen::Vector3d b_g(0.02, -0.05, 0.08);
  const double from_s = 0.0512, to_s = 0.3537;
  const Eigen::Matrix3d J = with_bias(b_g).BetweenByBias(from_s, to_s);
  constexpr double kStep = 1e-4;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
    const Eigen::Vector3d difference =
        Log(with_bias(b_g - step).Between(from_s, to_s).conjugate() *
            with_bias(b_g + step).Between(from_s, to_s)) /
        (2 * kStep);
    // The integral of the rotation is by the rule of the middle.
    EXPECT_LT((J.col(i) - difference).norm(), 1e-5) << i;
  }
  // Rotations are about the mean rate of a step, whose direction changes.
  EXPECT_LT((with_bias(b_g).RateAt(from_s) -
             Log(with_bias(b_g).Between(from_s - 1e-4, from_s + 1e-4)) / 2e-4)
                .norm(),
            1e-4);
}

TEST(GyroRotation, KeepsWhatIsNeededAfterATime) {
  GyroRotation all{ImuCalibration()};
  GyroRotation dropped{ImuCalibration()};
  for (int i = 0; i < 40; ++i) {
    const ImuSample sample =
        SampleAt(0.005 * i, {std::sin(0.3 * i), 0.1 * i, std::cos(0.2 * i)});
    all.Add(sample);
    dropped.Add(sample);
  }
  dropped.DropBefore(0.0934);
  EXPECT_LT(
      AngleBetween(dropped.Between(0.0934, 0.17), all.Between(0.0934, 0.17)),
      1e-12);
}

TEST(GyroRotation, IgnoresSamplesOutOfOrderAndIsTheIdentityWithoutAny) {
  GyroRotation rotation{ImuCalibration()};
  EXPECT_LT(AngleBetween(rotation.Between(0, 1), Exp({0, 0, 0})), 1e-15);
  rotation.Add(SampleAt(0, {1, 0, 0}));
  rotation.Add(SampleAt(0.1, {1, 0, 0}));
  rotation.Add(SampleAt(0.05, {50, 0, 0}));
  EXPECT_LT(AngleBetween(rotation.Between(0, 0.1), Exp({0.1, 0, 0})), 1e-12);
}

}  // namespace
}  // namespace selfcal
