#include "client/formats/orb_slam3.h"

#include <fmt/format.h>

#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

constexpr const char* kRadialTangential[] = {"k1", "k2", "p1", "p2"};
constexpr const char* kEquidistant[] = {"k1", "k2", "k3", "k4"};

DistortionModel ReadModel(const YAML::Node& root) {
  const std::string type = GetText(root, "Camera.type");
  if (type == "PinHole") return DistortionModel::kRadialTangential;
  if (type == "KannalaBrandt8") return DistortionModel::kEquidistant;
  throw FormatError(fmt::format(
      "Camera.type '{}' is not PinHole or KannalaBrandt8; a rectified image "
      "has another calibration than the camera",
      type));
}

CameraCalibration ReadCamera(const YAML::Node& root, int number) {
  const auto key = [number](const char* name) {
    return fmt::format("Camera{}.{}", number, name);
  };
  CameraCalibration camera;
  camera.f = {GetDouble(root, key("fx")), GetDouble(root, key("fy"))};
  camera.c = {GetDouble(root, key("cx")), GetDouble(root, key("cy"))};
  camera.model = ReadModel(root);
  camera.distortion = DistortionVector::Zero(4);
  const bool pinhole = camera.model == DistortionModel::kRadialTangential;
  if (!pinhole || Has(root, key("k1"))) {
    const auto& names = pinhole ? kRadialTangential : kEquidistant;
    for (int i = 0; i < 4; ++i) {
      camera.distortion[i] = GetDouble(root, key(names[i]));
    }
  }
  if (pinhole && GetDouble(root, key("k3"), 0) != 0) {
    throw FormatError(fmt::format(
        "{} is not 0: selfcal's radial-tangential model has k1 k2 p1 p2",
        key("k3")));
  }
  camera.width_px = GetInt(root, "Camera.width");
  camera.height_px = GetInt(root, "Camera.height");
  return camera;
}

std::string CameraText(const CameraCalibration& camera, std::size_t number) {
  const bool pinhole = camera.model == DistortionModel::kRadialTangential;
  const auto& names = pinhole ? kRadialTangential : kEquidistant;
  std::string text;
  const auto add = [&](const char* name, double value) {
    text += fmt::format("Camera{}.{}: {}\n", number, name, NumberText(value));
  };
  add("fx", camera.f.x());
  add("fy", camera.f.y());
  add("cx", camera.c.x());
  add("cy", camera.c.y());
  for (int i = 0; i < 4; ++i) add(names[i], camera.distortion[i]);
  if (!pinhole) {
    text += fmt::format(
        "Camera{0}.overlappingBegin: 0\nCamera{0}.overlappingEnd: {1}\n",
        number,
        camera.width_px - 1);
  }
  return text;
}

void CheckCameras(const std::vector<CameraCalibration>& cameras) {
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const CameraCalibration& camera = cameras[j];
    if (camera.model == DistortionModel::kFov) {
      NoSuchModel(
          "orb_slam3", j, camera.model, "radial-tangential and equidistant");
    }
    if (camera.model != cameras[0].model ||
        camera.width_px != cameras[0].width_px ||
        camera.height_px != cameras[0].height_px) {
      throw FormatError(
          "orb_slam3 has one distortion model and one image size for both "
          "cameras");
    }
  }
}

std::string NoiseText(const ImuNoise& noise, double rate_hz) {
  return fmt::format(
      "IMU.NoiseGyro: {}\n"
      "IMU.NoiseAcc: {}\n"
      "IMU.GyroWalk: {}\n"
      "IMU.AccWalk: {}\n"
      "IMU.Frequency: {}\n",
      NumberText(noise.gyro_noise_density),
      NumberText(noise.accel_noise_density),
      NumberText(noise.gyro_bias_random_walk),
      NumberText(noise.accel_bias_random_walk),
      NumberText(rate_hz));
}

}  // namespace

ImportedRig ImportOrbSlam3(const std::vector<TextFile>& files,
                           const FormatOptions&) {
  if (files.size() != 1) throw FormatError("give one settings file");
  const YAML::Node root = ParseYaml(files[0]);
  if (!Has(root, "File.version")) {
    throw FormatError(
        "File.version is missing: settings from before ORB-SLAM3 1.0 are not "
        "read");
  }
  ImportedRig result;
  result.rig.imu_noise = {
      .gyro_noise_density = GetDouble(root, "IMU.NoiseGyro"),
      .accel_noise_density = GetDouble(root, "IMU.NoiseAcc"),
      .gyro_bias_random_walk = GetDouble(root, "IMU.GyroWalk"),
      .accel_bias_random_walk = GetDouble(root, "IMU.AccWalk")};
  Eigen::Matrix4d T_BC =
      Rigid(GetMatrixData(root, "IMU.T_b_c1", 4, 4), "IMU.T_b_c1");
  for (int number = 1; number <= 2; ++number) {
    if (number == 2) {
      if (!Has(root, "Camera2.fx")) break;
      T_BC *=
          Rigid(GetMatrixData(root, "Stereo.T_c1_c2", 4, 4), "Stereo.T_c1_c2");
    }
    CameraCalibration camera = ReadCamera(root, number);
    SetTransformFromBody(
        RigidInverse(T_BC), Eigen::Matrix3d::Identity(), &camera);
    result.rig.factory.cameras.push_back(camera);
  }
  return result;
}

ExportedFiles ExportOrbSlam3(const Rig& rig,
                             const Calibration& theta,
                             const FormatOptions& options) {
  ExportedFiles result;
  Calibration kept = theta;
  KeepCameras("orb_slam3", 2, &kept, &result.losses);
  const std::vector<CameraCalibration>& cameras = kept.cameras;
  CheckCameras(cameras);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const bool pinhole = cameras[0].model == DistortionModel::kRadialTangential;
  std::string text = fmt::format(
      "%YAML:1.0\n---\n"
      "File.version: \"1.0\"\n"
      "Camera.type: \"{}\"\n"
      "Camera.width: {}\n"
      "Camera.height: {}\n",
      pinhole ? "PinHole" : "KannalaBrandt8",
      cameras[0].width_px,
      cameras[0].height_px);
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    text += CameraText(cameras[j], j + 1);
  }
  const Eigen::Matrix4d T_BC1 = RigidInverse(TransformFromBody(cameras[0], I));
  if (cameras.size() == 2) {
    const Eigen::Matrix4d T_C1C2 =
        TransformFromBody(cameras[0], I) *
        RigidInverse(TransformFromBody(cameras[1], I));
    text += "Stereo.T_c1_c2: " + OpenCvMatrixText(T_C1C2, 'f');
  }
  text += "IMU.T_b_c1: " + OpenCvMatrixText(T_BC1, 'f');
  text += NoiseText(rig.imu_noise,
                    ImuRate(options, "IMU.Frequency", &result.losses));
  AddImuLoss("orb_slam3", theta.imu, &result.losses);
  AddTimeOffsetLosses("orb_slam3", kept, &result.losses);
  AddGravityLoss("orb_slam3", rig, &result.losses);
  result.losses.push_back(
      {"settings",
       "those of its extractor, viewer and images (Camera.fps, Camera.RGB, "
       "ORBextractor.*, Stereo.ThDepth) are not part of a calibration: insert "
       "these lines into your file",
       false});
  result.files = {{"orb_slam3.yaml", text}};
  return result;
}

}  // namespace selfcal::client
