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
      {", 1.8e-05", "", "distortion_coefficients has 3 numbers instead of 4"},
      {"1.0, 0.0, 0.0, 0.2",
       "2.0, 0.0, 0.0, 0.2",
       "T_BS is not a rotation with a translation"}};
  for (const auto& [from, to, message] : wrong) {
    EXPECT_EQ(ParseCameraYaml(With(from, to)).status().message(), message);
  }
  EXPECT_FALSE(ParseCameraYaml("").ok());
  EXPECT_FALSE(ParseCameraYaml("%YAML:1.0").ok());
  EXPECT_FALSE(ParseCameraYaml("a: [").ok());
}

TEST(SensorYaml, EurocsOwnIsRead) {
  SELFCAL_NEED_RECORDING(folder, "euroc_images");
  const auto camera =
      ParseCameraYaml(ReadBytes(folder + "/mav0/cam0/sensor.yaml"));
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->f.x(), 458.654);
  EXPECT_EQ(camera->distortion[3], 1.76187114e-05);
}

}  // namespace
}  // namespace selfcal::client
