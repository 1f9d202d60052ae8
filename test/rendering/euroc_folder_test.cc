#include "test/rendering/euroc_folder.h"

#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "proto/convert.h"
#include "test/core/simulation/rigs.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal {
namespace {

std::vector<std::vector<std::string>> CsvRows(const std::string& text) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) {
      rows.back().push_back(cell);
    }
  }
  return rows;
}

class EurocFolder : public testing::Test {
 protected:
  // One recording for all tests, which only read it.
  static void SetUpTestSuite() {
    RenderOptions options;
    options.exposure_s = 0.002;
    Rig rig = StereoRig();
    for (CameraCalibration& camera : rig.factory.cameras) {
      camera.line_delay_s = 20e-6;
    }
    folder_ = std::make_unique<TempFolder>();
    recording_ = std::make_unique<RenderedRecording>(
        rig, MakeHandheld(0.3, 1, 1), options);
    WriteEurocFolder(*recording_, recording_->rig().factory, folder_->path());
  }
  static void TearDownTestSuite() {
    folder_.reset();
    recording_.reset();
  }

  static std::string Text(const std::string& name) {
    return ReadBytes(folder_->path() / "mav0" / name);
  }

  static std::unique_ptr<TempFolder> folder_;
  static std::unique_ptr<RenderedRecording> recording_;
};

std::unique_ptr<TempFolder> EurocFolder::folder_;
std::unique_ptr<RenderedRecording> EurocFolder::recording_;

TEST_F(EurocFolder, HasTheImagesOfEachCamera) {
  ASSERT_GE(recording_->images(), 5);
  for (const std::string camera : {"cam0", "cam1"}) {
    const auto rows = CsvRows(Text(camera + "/data.csv"));
    ASSERT_EQ(rows.size(), static_cast<std::size_t>(recording_->images()));
    for (int k = 0; k < recording_->images(); ++k) {
      const auto& row = rows[static_cast<std::size_t>(k)];
      ASSERT_EQ(row.size(), 2u);
      EXPECT_EQ(std::stoll(row[0]), kEurocEpoch_ns + recording_->stamp_ns(k));
      const cv::Mat image =
          cv::imread(folder_->path() / "mav0" / camera / "data" / row[1],
                     cv::IMREAD_UNCHANGED);
      ASSERT_EQ(image.type(), CV_8UC1);
      const GreyImage expected = recording_->Image(camera == "cam1", k);
      ASSERT_EQ(image.cols, expected.width_px);
      ASSERT_EQ(image.rows, expected.height_px);
      EXPECT_TRUE(std::equal(
          expected.pixels.begin(), expected.pixels.end(), image.data));
    }
  }
}

TEST_F(EurocFolder, HasTheReadingsToTheBit) {
  const auto rows = CsvRows(Text("imu0/data.csv"));
  ASSERT_EQ(rows.size(), recording_->imu().measured.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ImuSample& sample = recording_->imu().measured[i];
    ASSERT_EQ(rows[i].size(), 7u);
    EXPECT_EQ(std::stoll(rows[i][0]), kEurocEpoch_ns + sample.t_ns);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(std::stod(rows[i][1 + axis]), sample.gyro[axis]);
      EXPECT_EQ(std::stod(rows[i][4 + axis]), sample.accel[axis]);
    }
  }
}

TEST_F(EurocFolder, HasTheTrueStates) {
  const auto rows = CsvRows(Text("state_groundtruth_estimate0/data.csv"));
  ASSERT_EQ(rows.size(), recording_->imu().measured.size());
  const auto& row = rows[17];
  ASSERT_EQ(row.size(), 17u);
  const double t_s = (std::stoll(row[0]) - kEurocEpoch_ns) * 1e-9;
  const BodyMotion motion = recording_->trajectory().At(t_s);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(std::stod(row[1 + axis]), motion.p_GI[axis]);
    EXPECT_EQ(std::stod(row[8 + axis]), motion.v_GI[axis]);
    EXPECT_EQ(std::stod(row[11 + axis]), recording_->imu().b_g[17][axis]);
    EXPECT_EQ(std::stod(row[14 + axis]), recording_->imu().b_a[17][axis]);
  }
  EXPECT_EQ(std::stod(row[4]), motion.q_GI.w());
  EXPECT_EQ(std::stod(row[7]), motion.q_GI.z());
}

TEST_F(EurocFolder, DescribesTheCamerasAsEurocDoes) {
  for (int j = 0; j < 2; ++j) {
    const CameraCalibration& camera = recording_->rig().factory.cameras[j];
    const YAML::Node yaml =
        YAML::Load(Text("cam" + std::to_string(j) + "/sensor.yaml"));
    Eigen::Matrix4d T_BS;
    for (int i = 0; i < 16; ++i) {
      T_BS(i / 4, i % 4) = yaml["T_BS"]["data"][i].as<double>();
    }
    // A point on the axis of the camera, one metre away.
    const Eigen::Vector3d p_I = (T_BS * Eigen::Vector4d(0, 0, 1, 1)).head<3>();
    const Eigen::Vector3d p_C = camera.q_CI * p_I + camera.p_CI;
    EXPECT_LT((p_C - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    EXPECT_EQ(yaml["intrinsics"][1].as<double>(), camera.f.y());
    EXPECT_EQ(yaml["intrinsics"][2].as<double>(), camera.c.x());
    EXPECT_EQ(yaml["resolution"][1].as<int>(), camera.height_px);
    EXPECT_EQ(yaml["camera_model"].as<std::string>(), "pinhole");
    EXPECT_EQ(yaml["distortion_model"].as<std::string>(),
              j == 0 ? "radial-tangential" : "equidistant");
    EXPECT_EQ(yaml["distortion_coefficients"][3].as<double>(),
              camera.distortion[3]);
    EXPECT_EQ(yaml["line_delay_s"].as<double>(), 20e-6);
  }
}

TEST_F(EurocFolder, HasTheTrueCalibration) {
  v1::CalibrationParameters message;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(
                  ReadBytes(folder_->File("calibration.json")), &message)
                  .ok());
  Calibration theta;
  ASSERT_TRUE(FromProto(message, "", &theta).empty());
  const Calibration& truth = recording_->rig().factory;
  EXPECT_LT(BoxMinus(theta, truth).norm(), 1e-12);
  EXPECT_EQ(theta.cameras[1].width_px, truth.cameras[1].width_px);
}

TEST(EurocFolderErrors, NamesTheFileThatCannotBeWritten) {
  const TempFolder folder;
  // A file is where a folder should be.
  WriteBytes(folder.path() / "mav0", "");
  const RenderedRecording recording(
      HandheldRig("x"), MakeHandheld(0.2, 1, 1), {});
  try {
    WriteEurocFolder(recording, recording.rig().factory, folder.path());
    FAIL() << "it was written";
  } catch (const std::exception& e) {
    EXPECT_NE(std::string(e.what()).find("mav0"), std::string::npos);
  }
}

}  // namespace
}  // namespace selfcal
