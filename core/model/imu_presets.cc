#include "core/model/imu_presets.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <numbers>
#include <string>

namespace selfcal {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kG_mps2 = 9.80665;

// Readings end below the nominal range (ImuPreset::full_scale).
constexpr double kEndOfReadings = 0.998;

constexpr ImuNoise Noise(double gyro_mdps,     // [mdeg/s/sqrt(Hz)]
                         double accel_ug,      // [ug/sqrt(Hz)]
                         double gyro_walk,     // [rad/s^2/sqrt(Hz)]
                         double accel_walk) {  // [m/s^3/sqrt(Hz)]
  return {.gyro_noise_density = gyro_mdps * 1e-3 * kDegree,
          .accel_noise_density = accel_ug * 1e-6 * kG_mps2,
          .gyro_bias_random_walk = gyro_walk,
          .accel_bias_random_walk = accel_walk};
}

constexpr ImuFullScale FullScale(double gyro_dps, double accel_g) {
  return {.gyro_radps = kEndOfReadings * gyro_dps * kDegree,
          .accel_mps2 = kEndOfReadings * accel_g * kG_mps2};
}

// The walks of EuRoC (ADIS16448): this part, and those of which nothing was
// published.
constexpr double kEurocGyroWalk = 1.9393e-5;
constexpr double kEurocAccelWalk = 3e-3;

constexpr char kNothingPublished[] =
    "no measured value found: those of EuRoC (ADIS16448), conservative for a "
    "consumer part";
constexpr char kPx4[] = "driver of PX4";

constexpr std::array kPresets = {
    ImuPreset{.name = "adis16448",
              .part = "Analog Devices ADIS16448",
              .noise = Noise(13.5, 230, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(1000, 18),
              .grade = ImuGrade::kFactoryCalibrated,
              .density_source =
                  "data sheet ADIS16448: 0.0135 deg/s/sqrt(Hz), 0.23 "
                  "mg/sqrt(Hz)",
              .walk_source = "sensor.yaml of the EuRoC recordings",
              .range_source = "data sheet: 1000 deg/s, 18 g"},
    // Allan deviations of two RealSense cameras that have this part, D455 and
    // T265, in kalibr_imu_chain.yaml of rs_d455 and rs_t265: the larger ones,
    // 1.17e-6 and 6.7e-5.
    ImuPreset{.name = "bmi055",
              .part = "Bosch BMI055",
              .noise = Noise(14, 150, 1.17e-5, 6.7e-4),
              .full_scale = FullScale(1000, 4),
              .grade = ImuGrade::kConsumer,
              .density_source = "data sheet BST-BMI055-DS000 1.2: 0.014 "
                                "deg/s/sqrt(Hz), 150 ug/sqrt(Hz)",
              .walk_source =
                  "ten times the Allan deviations in OpenVINS' rs_d455 and "
                  "rs_t265",
              .range_source = "RealSense: 1000 deg/s, 4 g; other drivers: 2000 "
                              "deg/s, 16 g"},
    // 160 ug/sqrt(Hz) along x and y, 190 along z.
    ImuPreset{.name = "bmi088",
              .part = "Bosch BMI088",
              .noise = Noise(14, 190, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 24),
              .grade = ImuGrade::kConsumer,
              .density_source = "data sheet BST-BMI088-DS001 1.4: 0.014 "
                                "deg/s/sqrt(Hz), 190 ug/sqrt(Hz) along z",
              .walk_source = kNothingPublished,
              .range_source = kPx4},
    ImuPreset{.name = "bmi270",
              .part = "Bosch BMI270",
              .noise = Noise(7, 160, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 16),
              .grade = ImuGrade::kConsumer,
              .density_source = "data sheet BST-BMI270-DS000: 0.007 "
                                "deg/s/sqrt(Hz), 160 ug/sqrt(Hz)",
              .walk_source = kNothingPublished,
              .range_source = kPx4},
    ImuPreset{.name = "icm20948",
              .part = "TDK InvenSense ICM-20948",
              .noise = Noise(15, 230, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 16),
              .grade = ImuGrade::kConsumer,
              .density_source = "data sheet DS-000189 1.3: 0.015 "
                                "deg/s/sqrt(Hz), 230 ug/sqrt(Hz)",
              .walk_source = kNothingPublished,
              .range_source = kPx4},
    ImuPreset{.name = "icm42688",
              .part = "TDK InvenSense ICM-42688-P",
              .noise = Noise(2.8, 70, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 16),
              .grade = ImuGrade::kConsumer,
              .density_source =
                  "data sheet DS-000347 1.7: 2.8 mdeg/s/sqrt(Hz), "
                  "70 ug/sqrt(Hz)",
              .walk_source = kNothingPublished,
              .range_source = kPx4},
    // 70, 75, 80 and 110 ug/sqrt(Hz) at 2, 4, 8 and 16 g.
    ImuPreset{.name = "lsm6dso",
              .part = "ST LSM6DSO",
              .noise = Noise(3.8, 75, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 4),
              .grade = ImuGrade::kConsumer,
              .density_source = "data sheet DS12140 2, high-performance mode: "
                                "3.8 mdeg/s/sqrt(Hz), 75 ug/sqrt(Hz) at 4 g",
              .walk_source = kNothingPublished,
              .range_source = "driver of ESPHome: 2000 deg/s, 4 g"},
    ImuPreset{.name = "mpu9250",
              .part = "InvenSense MPU-9250",
              .noise = Noise(10, 300, kEurocGyroWalk, kEurocAccelWalk),
              .full_scale = FullScale(2000, 16),
              .grade = ImuGrade::kConsumer,
              .density_source = "product specification PS-MPU-9250A-01 1.0: "
                                "0.01 deg/s/sqrt(Hz), 300 ug/sqrt(Hz)",
              .walk_source = kNothingPublished,
              .range_source = kPx4}};

std::string Plain(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) continue;
    plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

}  // namespace

std::span<const ImuPreset> ImuPresets() { return kPresets; }

const ImuPreset* FindImuPreset(std::string_view name) {
  const std::string plain = Plain(name) == "lsm6ds" ? "lsm6dso" : Plain(name);
  const auto found =
      std::ranges::find_if(kPresets, [&](const ImuPreset& preset) {
        return plain == preset.name ||
               plain ==
                   Plain(preset.part.substr(preset.part.find_last_of(' ') + 1));
      });
  return found == kPresets.end() ? nullptr : &*found;
}

}  // namespace selfcal
