#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/formats/format.h"

namespace selfcal::client {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;

constexpr char kSensors[] = R"(
sensors:
  - id: a
    sensor_type: ODOMETRY_6DOF
  - id: b
    sensor_type: IMU
    sigmas:
      gyro_noise_density: 0.001
      gyro_bias_random_walk_noise_density: 0.002
      acc_noise_density: 0.003
      acc_bias_random_walk_noise_density: 0.004
    gravity_magnitude_mps2: 9.80
  - id: c
    sensor_type: NCAMERA
    cameras:
      - camera:
          image_height: 480
          image_width: 640
          intrinsics: {data: [250, 251, 320, 240]}
          distortion:
            type: fisheye
            parameters: {data: [0.9]}
        T_B_C:
          data:
            - [0, -1, 0, 0.1]
            - [1, 0, 0, 0.2]
            - [0, 0, 1, 0.3]
            - [0, 0, 0, 1]
)";

std::string Replaced(const std::string& from, const std::string& to) {
  std::string text = kSensors;
  return text.replace(text.find(from), from.size(), to);
}

absl::StatusOr<ImportedRig> Import(const std::string& text) {
  return ImportRig("maplab", {{"sensors.yaml", text}}, {});
}

std::string Error(const std::string& text) {
  return std::string(Import(text).status().message());
}

TEST(ImportMaplab, ACameraNeedsNoDistortionAndTheTransformOfOneDirection) {
  const std::string distortion = R"(          distortion:
            type: fisheye
            parameters: {data: [0.9]}
)";
  const auto without = Import(Replaced(distortion, ""));
  ASSERT_TRUE(without.ok()) << without.status();
  const CameraCalibration& camera = without->rig.factory.cameras.at(0);
  EXPECT_EQ(camera.model, DistortionModel::kRadialTangential);
  EXPECT_EQ(camera.distortion, Eigen::Vector4d::Zero());
  const auto body_in_camera = Import(Replaced("T_B_C", "T_C_B"));
  ASSERT_TRUE(body_in_camera.ok()) << body_in_camera.status();
  EXPECT_EQ(body_in_camera->rig.factory.cameras.at(0).p_CI,
            Eigen::Vector3d(0.1, 0.2, 0.3));
}

TEST(ImportMaplab, ReadsNoiseCameraAndInvertsExtrinsics) {
  const auto imported = Import(kSensors);
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_TRUE(imported->losses.empty());
  const Rig* rig = &imported->rig;
  EXPECT_EQ(rig->imu_noise.gyro_noise_density, 0.001);
  EXPECT_EQ(rig->imu_noise.gyro_bias_random_walk, 0.002);
  EXPECT_EQ(rig->imu_noise.accel_noise_density, 0.003);
  EXPECT_EQ(rig->imu_noise.accel_bias_random_walk, 0.004);
  EXPECT_EQ(rig->gravity_mps2, 9.80);
  ASSERT_EQ(rig->factory.cameras.size(), 1u);
  const CameraCalibration& camera = rig->factory.cameras[0];
  EXPECT_EQ(camera.f, Eigen::Vector2d(250, 251));
  EXPECT_EQ(camera.c, Eigen::Vector2d(320, 240));
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_EQ(camera.height_px, 480);
  // T_CI takes the camera's place in B to its own origin.
  EXPECT_LT((camera.q_CI * Eigen::Vector3d(0.1, 0.2, 0.3) + camera.p_CI).norm(),
            1e-12);
  EXPECT_LT((camera.q_CI * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitY())
                .norm(),
            1e-12);
}

TEST(ImportMaplab, ASecondImuAndASecondCameraSystemAreLost) {
  std::string text = kSensors;
  const std::size_t imu = text.find("  - id: b");
  const std::size_t system = text.find("  - id: c");
  text += text.substr(imu, system - imu);
  text += std::string(kSensors).substr(system);
  const auto imported = Import(text);
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_EQ(imported->rig.factory.cameras.size(), 1u);
  EXPECT_THAT(imported->losses,
              ElementsAre(AllOf(Field(&Loss::name, "imu1"),
                                Field(&Loss::changes_prediction, true)),
                          AllOf(Field(&Loss::name, "ncamera1"),
                                Field(&Loss::changes_prediction, true))));
}

TEST(ImportMaplab, ReadsTheRangeOfTheImu) {
  const std::string gravity = "    gravity_magnitude_mps2: 9.80\n";
  const auto imported =
      Import(Replaced(gravity,
                      gravity + "    saturation_accel_max_mps2: 78.5\n"
                                "    saturation_gyro_max_radps: 17.5\n"));
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_EQ(imported->rig.imu_full_scale.accel_mps2, 78.5);
  EXPECT_EQ(imported->rig.imu_full_scale.gyro_radps, 17.5);
}

// 150 m/s^2 and 7.5 rad/s are in most files, whatever the sensor.
TEST(ImportMaplab, TakesTheDefaultOfMaplabForNoRange) {
  const std::string gravity = "    gravity_magnitude_mps2: 9.80\n";
  for (const std::string range : {"",
                                  "    saturation_accel_max_mps2: 150.0\n"
                                  "    saturation_gyro_max_radps: 7.5\n",
                                  "    saturation_accel_max_mps2: 0\n"
                                  "    saturation_gyro_max_radps: 0\n"}) {
    const auto imported = Import(Replaced(gravity, gravity + range));
    ASSERT_TRUE(imported.ok()) << imported.status();
    EXPECT_EQ(imported->rig.imu_full_scale.accel_mps2, 156.9064) << range;
    EXPECT_EQ(imported->rig.imu_full_scale.gyro_radps, 34.9065850) << range;
  }
}

TEST(ExportMaplab, WritesTheRangeOfTheImu) {
  Rig rig = Import(kSensors)->rig;
  rig.imu_full_scale = {.gyro_radps = 17.5, .accel_mps2 = 78.5};
  const auto exported = ExportRig("maplab", rig, rig.factory, {});
  ASSERT_TRUE(exported.ok()) << exported.status();
  EXPECT_THAT(exported->files[0].text,
              AllOf(HasSubstr("    saturation_accel_max_mps2: 78.5\n"),
                    HasSubstr("    saturation_gyro_max_radps: 17.5\n")));
  EXPECT_THAT(exported->losses, ElementsAre(Field(&Loss::name, "sigmas")));
}

TEST(ImportMaplab, ALineDelayIsARollingShutter) {
  const std::string height = "          image_height: 480\n";
  const auto imported = Import(
      Replaced(height, "          line-delay-nanoseconds: 61500\n" + height));
  ASSERT_TRUE(imported.ok()) << imported.status();
  EXPECT_TRUE(imported->losses.empty());
  EXPECT_EQ(imported->rig.factory.cameras[0].line_delay_s, 61.5e-6);
  const auto exported =
      ExportRig("maplab", imported->rig, imported->rig.factory, {});
  ASSERT_TRUE(exported.ok()) << exported.status();
  EXPECT_THAT(exported->files[0].text,
              HasSubstr("line-delay-nanoseconds: 61500\n"));
}

TEST(ImportMaplab, EveryMistakeIsNamedWithTheFile) {
  EXPECT_THAT(Error(Replaced("fisheye", "unknown")),
              HasSubstr("sensors.yaml: distortion type 'unknown'"));
  EXPECT_THAT(Error(Replaced("[0.9]", "[0.9, 1]")),
              HasSubstr("'parameters' needs 1 x 1"));
  EXPECT_THAT(Error(Replaced("gyro_noise_density", "x")),
              HasSubstr("'gyro_noise_density' is missing"));
  EXPECT_THAT(Error(Replaced("[1, 0, 0, 0.2]", "[2, 0, 0, 0.2]")),
              HasSubstr("rigid"));
  EXPECT_THAT(Error(Replaced("NCAMERA", "LIDAR")), HasSubstr("NCAMERA"));
  EXPECT_THAT(Error("sensors: ["), HasSubstr("sensors.yaml"));
  EXPECT_THAT(Error(""), HasSubstr("'sensors' is missing"));
  EXPECT_THAT(Error(Replaced("250, 251", "250, nonsense")),
              HasSubstr("sensors.yaml"));
}

}  // namespace
}  // namespace selfcal::client
