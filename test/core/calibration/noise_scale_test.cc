#include "core/calibration/noise_scale.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

double Gyro(const Rig& rig) { return rig.imu_noise.gyro_noise_density; }

TEST(NoiseScale, NamesFindTheirKinds) {
  for (int i = 0; i < kNoiseKinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    EXPECT_EQ(FindNoiseKind(NoiseKindName(kind)), kind);
  }
  EXPECT_FALSE(FindNoiseKind("voxel").has_value());
}

TEST(NoiseScale, EachKindScalesItsOwnNoise) {
  const Rig before = HandheldRig("r");
  Rig rig = before;
  for (int i = 0; i < kNoiseKinds; ++i) {
    ScaleNoise(static_cast<NoiseKind>(i), 2 + i, &rig);
  }
  for (int i = 0; i < kNoiseKinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    EXPECT_EQ(NoiseOf(kind, rig), (2 + i) * NoiseOf(kind, before));
  }
}

TEST(Reweight, AppliesScalesThatAreDeterminedOrFarOff) {
  const Rig rig = HandheldRig("r");
  const auto next = Reweight(rig,
                             rig,
                             {{NoiseKind::kPixel, 1.1, 0.01},
                              {NoiseKind::kGyro, 3, 0.05},
                              {NoiseKind::kAccel, 3, 0.3},
                              {NoiseKind::kGyroBiasWalk, 3, 1.2},
                              {NoiseKind::kAccelBiasWalk, 0.1, 2}});
  ASSERT_TRUE(next.has_value());
  // The root of the mean variance: larger by the variance of the logarithm.
  EXPECT_DOUBLE_EQ(next->pixel_sigma_px,
                   1.1 * std::exp(1e-4) * rig.pixel_sigma_px);
  EXPECT_DOUBLE_EQ(Gyro(*next), 3 * std::exp(2.5e-3) * Gyro(rig));
  EXPECT_DOUBLE_EQ(next->imu_noise.accel_noise_density,
                   3 * std::exp(0.09) * rig.imu_noise.accel_noise_density);
  EXPECT_EQ(next->imu_noise.gyro_bias_random_walk,
            rig.imu_noise.gyro_bias_random_walk);
  EXPECT_EQ(next->imu_noise.accel_bias_random_walk,
            rig.imu_noise.accel_bias_random_walk);
}

TEST(Reweight, ReturnsNothingIfNoScaleIsFarOff) {
  const Rig rig = HandheldRig("r");
  EXPECT_FALSE(Reweight(rig, rig, {{NoiseKind::kGyro, 1.04, 0.01}}));
  EXPECT_FALSE(Reweight(rig, rig, {{NoiseKind::kGyro, 2, 0.8}}));
  EXPECT_FALSE(Reweight(rig, rig, {}));
  EXPECT_TRUE(Reweight(rig, rig, {{NoiseKind::kGyro, 0.7, 0.01}}));
}

TEST(Reweight, StaysWithinBoundsOfTheStatedNoise) {
  const Rig rig = HandheldRig("r");
  std::optional<Rig> taken = rig;
  for (int i = 0; i < 2; ++i) {
    taken = Reweight(rig, *taken, {{NoiseKind::kGyro, 10, 0.01}});
    ASSERT_TRUE(taken.has_value());
  }
  EXPECT_NEAR(Gyro(*taken), 30 * Gyro(rig), 1e-12);
  EXPECT_FALSE(Reweight(rig, *taken, {{NoiseKind::kGyro, 10, 0.01}}));
  const auto least = Reweight(rig, rig, {{NoiseKind::kGyro, 0.001, 0.01}});
  ASSERT_TRUE(least.has_value());
  EXPECT_NEAR(Gyro(*least), Gyro(rig) / 30, 1e-12);
}

TEST(Reweight, TakesNoPixelsForBetterThanATrackerIs) {
  Rig rig = HandheldRig("r");
  rig.pixel_sigma_px = 0.5;
  const auto next = Reweight(rig, rig, {{NoiseKind::kPixel, 0.04, 0.01}});
  ASSERT_TRUE(next.has_value());
  EXPECT_DOUBLE_EQ(next->pixel_sigma_px, 0.05);
  // A rig may state less, and more is possible.
  rig.pixel_sigma_px = 0.02;
  EXPECT_FALSE(Reweight(rig, rig, {{NoiseKind::kPixel, 0.5, 0.01}}));
  EXPECT_NEAR(
      Reweight(rig, rig, {{NoiseKind::kPixel, 4, 0.01}})->pixel_sigma_px,
      0.08,
      1e-4);
}

}  // namespace
}  // namespace selfcal
