#include "client/recording/sensor_yaml.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>

#include "test/recordings.h"
#include "test/support/files.h"

namespace selfcal::client {
namespace {

const char kYaml[] =
    "%YAML:1.0\n"
    "sensor_type: camera\n"
    "T_BS:\n"
    "  cols: 4\n"
    "  rows: 4\n"
    "  data: [0.0, -1.0, 0.0, 0.1,\n"
    "         1.0, 0.0, 0.0, 0.2,\n"
    "         0.0, 0.0, 1.0, 0.3,\n"
    "         0.0, 0.0, 0.0, 1.0]\n"
    "resolution: [752, 480]\n"
    "camera_model: pinhole\n"
    "intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
    "distortion_model: radial-tangential\n"
    "distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]\n";

std::string With(const std::string& from, const std::string& to) {
  std::string text = kYaml;
  return text.replace(text.find(from), from.size(), to);
}

TEST(SensorYaml, IsReadInTheConventionsOfTheProject) {
  const auto camera = ParseCameraYaml(kYaml);
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->width_px, 752);
  EXPECT_EQ(camera->height_px, 480);
  EXPECT_EQ(camera->f, Eigen::Vector2d(458.6, 457.3));
  EXPECT_EQ(camera->c, Eigen::Vector2d(367.2, 248.4));
  EXPECT_EQ(camera->model, DistortionModel::kRadialTangential);
  EXPECT_EQ(camera->distortion[1], 0.07);
  // T_BS takes (1, 2, 3) of the camera to (-2, 1, 3) + (0.1, 0.2, 0.3).
  const Eigen::Vector3d p_C =
      camera->q_CI * Eigen::Vector3d(-1.9, 1.2, 3.3) + camera->p_CI;
  EXPECT_LT((p_C - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
}

TEST(SensorYaml, WhatIsWrongIsNamed) {
  const std::string wrong[][3] = {
      {"resolution: [752, 480]",
       "resolution: [752]",
       "resolution has 1 numbers instead of 2"},
      {"resolution: [752, 480]",
       "resolution: [0, 480]",
       "resolution is not positive"},
      {"intrinsics:", "intrinsic:", "intrinsics is not a list of numbers"},
      {"[458.6", "[x", "intrinsics is not a list of numbers"},
      {"458.6", ".nan", "intrinsics has a number that is not finite"},
      {"radial-tangential", "brown", "distortion_model 'brown' is not known"},
      {"sensor_type: camera",
       "time_offset_s: .nan",
       "time_offset_s is not finite"},
      {", 1.8e-05", "", "distortion_coefficients has 3 numbers instead of 4"},
      {"1.0, 0.0, 0.0, 0.2",
       "2.0, 0.0, 0.0, 0.2",
       "T_BS is not a rotation with a translation"}};
  for (const auto& [from, to, message] : wrong) {
    EXPECT_EQ(ParseCameraYaml(With(from, to)).status().message(), message);
  }
  EXPECT_FALSE(
      ParseCameraYaml(With("sensor_type: camera", "time_offset_s: 5ms")).ok());
  EXPECT_FALSE(ParseCameraYaml("").ok());
  EXPECT_FALSE(ParseCameraYaml("%YAML:1.0").ok());
  EXPECT_FALSE(ParseCameraYaml("a: [").ok());
}

TEST(SensorYaml, TheNoiseOfAnImuIsThatOfFourDensities) {
  const std::string four =
      "gyroscope_noise_density: 1.0e-04\n"
      "gyroscope_random_walk: 2.0e-05\n"
      "accelerometer_noise_density: 3.0e-03\n"
      "accelerometer_random_walk: 4.0e-03\n";
  const auto imu = ParseImuYaml("sensor_type: imu\n" + four);
  ASSERT_TRUE(imu.ok()) << imu.status();
  ASSERT_TRUE(imu->noise);
  EXPECT_EQ(imu->noise->gyro_noise_density, 1e-4);
  EXPECT_EQ(imu->noise->gyro_bias_random_walk, 2e-5);
  EXPECT_EQ(imu->noise->accel_noise_density, 3e-3);
  EXPECT_EQ(imu->noise->accel_bias_random_walk, 4e-3);
  EXPECT_TRUE(imu->T_BI.isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_FALSE(ParseImuYaml("gyroscope_noise_density: 1.0e-04\n")->noise);
  EXPECT_EQ(ParseImuYaml("accelerometer_random_walk: 0\n").status().message(),
            "accelerometer_random_walk is not positive");
}

TEST(SensorYaml, EurocsOwnIsRead) {
  SELFCAL_NEED_RECORDING(folder, "euroc_images");
  const auto camera =
      ParseCameraYaml(ReadBytes(folder + "/mav0/cam0/sensor.yaml"));
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->f.x(), 458.654);
  EXPECT_EQ(camera->distortion[3], 1.76187114e-05);
  const auto imu = ParseImuYaml(ReadBytes(folder + "/mav0/imu0/sensor.yaml"));
  ASSERT_TRUE(imu.ok()) << imu.status();
  ASSERT_TRUE(imu->noise);
  EXPECT_EQ(imu->noise->gyro_noise_density, 1.6968e-4);
  EXPECT_EQ(imu->noise->accel_bias_random_walk, 3e-3);
}

}  // namespace
}  // namespace selfcal::client
