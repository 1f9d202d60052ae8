#include "client/formats/camera_chain.h"

#include <fmt/format.h>

#include "client/formats/format_error.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

std::string ModelText(DistortionModel model) {
  switch (model) {
    case DistortionModel::kFov:
      return "fov";
    case DistortionModel::kRadialTangential:
      return "radtan";
    case DistortionModel::kEquidistant:
      break;
  }
  return "equidistant";
}

void ReadDistortion(const YAML::Node& node, CameraCalibration* camera) {
  const std::string text = GetText(node, "distortion_model");
  if (text == "none") {
    camera->model = DistortionModel::kRadialTangential;
    camera->distortion = DistortionVector::Zero(4);
    return;
  }
  for (const DistortionModel model : {DistortionModel::kFov,
                                      DistortionModel::kRadialTangential,
                                      DistortionModel::kEquidistant}) {
    if (text != ModelText(model)) continue;
    camera->model = model;
    camera->distortion =
        GetMatrix(node, "distortion_coeffs", DistortionSize(model), 1);
    return;
  }
  throw FormatError(fmt::format(
      "distortion_model '{}' is not radtan, equidistant, fov or none", text));
}

}  // namespace

ChainFiles ReadChainFiles(const std::vector<TextFile>& files) {
  ChainFiles result;
  for (const TextFile& file : files) {
    const YAML::Node root = ParseYaml(file);
    const bool cameras = Has(root, "cam0");
    (cameras ? result.cameras : result.imu)
        .reset(!cameras && Has(root, "imu0") ? root["imu0"] : root);
  }
  if (files.size() != 2 || !result.cameras.IsMap() || !result.imu.IsMap()) {
    throw FormatError(
        "give two files: that of the cameras (cam0, cam1, ...) and that of the "
        "IMU");
  }
  return result;
}

CameraCalibration ReadChainCamera(const YAML::Node& node) {
  const std::string projection = GetText(node, "camera_model");
  if (projection != "pinhole") {
    throw FormatError(
        fmt::format("camera_model '{}' is not pinhole", projection));
  }
  CameraCalibration camera;
  const Eigen::Vector4d intrinsics = GetMatrix(node, "intrinsics", 4, 1);
  camera.f = intrinsics.head<2>();
  camera.c = intrinsics.tail<2>();
  ReadDistortion(node, &camera);
  const std::vector<int> size = GetInts(node, "resolution", 2);
  camera.width_px = size[0];
  camera.height_px = size[1];
  camera.time_offset_s = GetDouble(node, "timeshift_cam_imu", 0);
  return camera;
}

std::string ChainCameraText(const CameraCalibration& camera) {
  const DistortionVector& k = camera.distortion;
  return fmt::format(
      "  camera_model: pinhole\n"
      "  intrinsics: {}\n"
      "  distortion_model: {}\n"
      "  distortion_coeffs: {}\n"
      "  resolution: [{}, {}]\n"
      "  timeshift_cam_imu: {}\n",
      ListText(
          std::vector{camera.f.x(), camera.f.y(), camera.c.x(), camera.c.y()}),
      ModelText(camera.model),
      ListText({k.data(), static_cast<std::size_t>(k.size())}),
      camera.width_px,
      camera.height_px,
      NumberText(camera.time_offset_s));
}

ImuNoise ReadChainNoise(const YAML::Node& imu) {
  return {
      .gyro_noise_density = GetDouble(imu, "gyroscope_noise_density"),
      .accel_noise_density = GetDouble(imu, "accelerometer_noise_density"),
      .gyro_bias_random_walk = GetDouble(imu, "gyroscope_random_walk"),
      .accel_bias_random_walk = GetDouble(imu, "accelerometer_random_walk")};
}

std::string ChainNoiseText(const ImuNoise& noise, double rate_hz) {
  return fmt::format(
      "  accelerometer_noise_density: {}\n"
      "  accelerometer_random_walk: {}\n"
      "  gyroscope_noise_density: {}\n"
      "  gyroscope_random_walk: {}\n"
      "  update_rate: {}\n"
      "  time_offset: 0.0\n"
      "  rostopic: /imu0\n",
      NumberText(noise.accel_noise_density),
      NumberText(noise.accel_bias_random_walk),
      NumberText(noise.gyro_noise_density),
      NumberText(noise.gyro_bias_random_walk),
      NumberText(rate_hz));
}

}  // namespace selfcal::client
