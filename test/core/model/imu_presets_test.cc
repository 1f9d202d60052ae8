#include "core/model/imu_presets.h"

#include <gtest/gtest.h>

#include <numbers>
#include <set>
#include <string>

#include "core/model/rig.h"
#include "core/model/saturation.h"

namespace selfcal {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

TEST(ImuPresets, EachMakesAValidRigAndNamesItsSources) {
  std::set<std::string_view> names;
  for (const ImuPreset& preset : ImuPresets()) {
    Rig rig;
    rig.id = "a";
    rig.factory.cameras.resize(1);
    const std::size_t faults = Validate(rig).size();
    rig.imu_noise = preset.noise;
    rig.imu_full_scale = preset.full_scale;
    rig.prior_sigmas = ImuTolerances(preset.grade);
    EXPECT_EQ(Validate(rig).size(), faults) << preset.name;
    EXPECT_FALSE(preset.density_source.empty()) << preset.name;
    EXPECT_FALSE(preset.walk_source.empty()) << preset.name;
    EXPECT_FALSE(preset.range_source.empty()) << preset.name;
    EXPECT_TRUE(names.insert(preset.name).second) << preset.name;
  }
  for (const char* name : {"adis16448",
                           "bmi055",
                           "bmi088",
                           "bmi270",
                           "icm20948",
                           "icm42688",
                           "lsm6dso",
                           "mpu9250"}) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
}

TEST(ImuPresets, AreFoundByTheNameOfThePart) {
  ASSERT_NE(FindImuPreset("bmi055"), nullptr);
  EXPECT_EQ(FindImuPreset("BMI055"), FindImuPreset("bmi055"));
  EXPECT_EQ(FindImuPreset("ICM-20948"), FindImuPreset("icm20948"));
  EXPECT_EQ(FindImuPreset("ICM-42688-P"), FindImuPreset("icm42688"));
  EXPECT_EQ(FindImuPreset("LSM6DS"), FindImuPreset("lsm6dso"));
  EXPECT_EQ(FindImuPreset("lsm6ds3"), nullptr);
  EXPECT_EQ(FindImuPreset("bosch"), nullptr);
  EXPECT_EQ(FindImuPreset(""), nullptr);
}

// The figures of the data sheets in SI units, converted by hand.
TEST(ImuPresets, HaveTheUnitsOfARig) {
  const ImuPreset& mpu = *FindImuPreset("mpu9250");
  EXPECT_NEAR(mpu.noise.gyro_noise_density, 1.745e-4, 1e-7);
  EXPECT_NEAR(mpu.noise.accel_noise_density, 2.942e-3, 1e-6);
  const ImuPreset& icm = *FindImuPreset("icm42688");
  EXPECT_NEAR(icm.noise.gyro_noise_density, 4.887e-5, 1e-8);
  EXPECT_NEAR(icm.noise.accel_noise_density, 6.865e-4, 1e-7);
  const ImuPreset& adis = *FindImuPreset("adis16448");
  EXPECT_NEAR(adis.noise.gyro_noise_density, 2.356e-4, 1e-7);
  EXPECT_NEAR(adis.full_scale.gyro_radps, 17.418, 1e-3);
  EXPECT_NEAR(adis.full_scale.accel_mps2, 176.17, 1e-2);
}

// Counts and sensitivities of the data sheets: the last reading before the end
// of the range is saturated, 99 % of the range is not.
TEST(ImuPresets, TheLastReadingOfARangeIsSaturated) {
  struct Sensor {
    const char* name;
    double last_dps;
    double last_g;
  };
  for (const Sensor& sensor :
       {Sensor{"mpu9250", 32767 / 16.4, 32767 / 2048.0},
        Sensor{"icm20948", 32767 / 16.4, 32767 / 2048.0},
        Sensor{"bmi088", 32767 / 16.384, 32767 / 1365.0},
        Sensor{"bmi055", 32767 / 32.8, 2047 / 512.0},
        Sensor{"lsm6dso", 32767 * 0.070, 32767 * 0.122e-3}}) {
    const ImuFullScale full_scale = FindImuPreset(sensor.name)->full_scale;
    MotionSegment segment;
    segment.imu = {
        {0, {0, -sensor.last_dps * kDegree, 0}, {0, 0, 9.8}},
        {1, {0, 0, 0}, {sensor.last_g * 9.80665, 0, 0}},
        {2, Eigen::Vector3d::Constant(0.99 * full_scale.gyro_radps), {0, 0, 9}},
        {3, {0, 0, 0}, Eigen::Vector3d::Constant(0.99 * full_scale.accel_mps2)},
    };
    EXPECT_EQ(CountSaturatedReadings(segment.imu, full_scale), 2u)
        << sensor.name;
    RemoveSaturatedReadings(full_scale, &segment.imu);
    EXPECT_EQ(segment.imu.front().t_ns, 2) << sensor.name;
  }
}

}  // namespace
}  // namespace selfcal
