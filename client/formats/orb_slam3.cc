#include "client/formats/orb_slam3.h"

#include <fmt/format.h>

#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

constexpr char kFisheye[] = "KannalaBrandt8";

FoundModel ReadModel(const YAML::Node& root, const std::string& camera) {
  const std::string type = GetText(root, "Camera.type");
  const auto is_zero = [&](const std::string& name) {
    return GetDouble(root, camera + name, 0) == 0;
  };
  if (const auto model = FindModel("orb_slam3", type, {}, is_zero)) {
    return *model;
  }
  throw FormatError(fmt::format(
      "Camera.type '{}' is not one of {}; a rectified image has another "
      "calibration than the camera",
      type,
      ToolModelNames("orb_slam3")));
}

CameraCalibration ReadCamera(const YAML::Node& root, int number) {
  const auto key = [number](const std::string& name) {
    return fmt::format("Camera{}.{}", number, name);
  };
  CameraCalibration camera;
  camera.f = {GetDouble(root, key("fx")), GetDouble(root, key("fy"))};
  camera.c = {GetDouble(root, key("cx")), GetDouble(root, key("cy"))};
  const auto [model, tool] = ReadModel(root, key(""));
  camera.model = model;
  camera.distortion = Undistorted(model);
  // A pinhole may have no coefficients.
  if (tool->name == kFisheye || Has(root, key("k1"))) {
    const std::vector<std::string> names = Words(tool->coefficients);
    for (std::size_t i = 0; i < names.size(); ++i) {
      camera.distortion[static_cast<Eigen::Index>(i)] =
          GetDouble(root, key(names[i]));
    }
  }
  camera.width_px = GetInt(root, "Camera.width");
  camera.height_px = GetInt(root, "Camera.height");
  return camera;
}

std::string CameraText(const CameraCalibration& camera, std::size_t number) {
  const ToolModel& tool = *FindToolModel("orb_slam3", camera.model);
  const std::vector<std::string> names = Words(tool.coefficients);
  std::string text;
  const auto add = [&](const std::string& name, double value) {
    text += fmt::format("Camera{}.{}: {}\n", number, name, NumberText(value));
  };
  add("fx", camera.f.x());
  add("fy", camera.f.y());
  add("cx", camera.c.x());
  add("cy", camera.c.y());
  for (std::size_t i = 0; i < names.size(); ++i) {
    add(names[i], camera.distortion[static_cast<Eigen::Index>(i)]);
  }
  if (tool.name == kFisheye) {
    text += fmt::format(
        "Camera{0}.overlappingBegin: 0\nCamera{0}.overlappingEnd: {1}\n",
        number,
        camera.width_px - 1);
  }
  return text;
}

void CheckCameras(const std::vector<CameraCalibration>& cameras) {
  for (const CameraCalibration& camera : cameras) {
    if (FindToolModel("orb_slam3", camera.model)->name !=
            FindToolModel("orb_slam3", cameras[0].model)->name ||
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
  UseModelsOf("orb_slam3", &kept.cameras);
  const std::vector<CameraCalibration>& cameras = kept.cameras;
  CheckCameras(cameras);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  std::string text = fmt::format(
      "%YAML:1.0\n---\n"
      "File.version: \"1.0\"\n"
      "Camera.type: \"{}\"\n"
      "Camera.width: {}\n"
      "Camera.height: {}\n",
      FindToolModel("orb_slam3", cameras[0].model)->name,
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
  // Its inverse takes larger angles for 90 degrees.
  AddPinholeLosses("orb_slam3", cameras, &result.losses, {kFisheye});
  AddImuLoss("orb_slam3", theta.imu, &result.losses);
  AddTimeOffsetLosses("orb_slam3", kept, &result.losses);
  AddLineDelayLosses("orb_slam3", kept, &result.losses);
  AddTimeDriftLosses("orb_slam3", kept, &result.losses);
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
