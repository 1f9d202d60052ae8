#include "client/formats/camera_chain.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/formats/format_error.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

// The tool that has the names of all models of a chain; OpenVINS has some of
// them.
constexpr char kKalibr[] = "kalibr";

Eigen::VectorXd ReadList(const YAML::Node& node,
                         const std::string& key,
                         Eigen::Index size) {
  return size == 0
             ? Eigen::VectorXd()
             : Eigen::VectorXd(GetMatrix(node, key, static_cast<int>(size), 1));
}

FoundModel ReadModel(const std::string& projection,
                     const std::string& distortion) {
  const auto find = [&](std::string_view name) {
    return FindModel(
        kKalibr, projection, name, [](const auto&) { return true; });
  };
  auto model = find(distortion);
  // A model without distortion is one whose coefficients are zero.
  if (!model && distortion == "none") model = find("radtan");
  if (model) return *model;
  throw FormatError(
      fmt::format("camera_model '{}' with distortion_model '{}' is not "
                  "supported: the models are {}",
                  projection,
                  distortion,
                  ToolModelNames(kKalibr)));
}

void ReadIntrinsics(const YAML::Node& node, CameraCalibration* camera) {
  const std::string distortion = GetText(node, "distortion_model");
  const auto [model, found] =
      ReadModel(GetText(node, "camera_model"), distortion);
  const ToolModel& tool = *found;
  camera->model = model;
  camera->distortion = Undistorted(model);
  const Eigen::VectorXd all =
      ReadList(node, "intrinsics", tool.before_pixels + 4);
  camera->f = all.segment<2>(tool.before_pixels);
  camera->c = all.tail<2>();
  camera->distortion.head(tool.before_pixels) = all.head(tool.before_pixels);
  if (tool.distortion != distortion) return;
  const Eigen::Index rest = camera->distortion.size() - tool.before_pixels;
  camera->distortion.tail(rest) = ReadList(node, "distortion_coeffs", rest);
}

}  // namespace

ChainFiles ReadChainFiles(const std::vector<TextFile>& files, int imu_files) {
  ChainFiles result;
  int of_cameras = 0, of_imus = 0;
  for (const TextFile& file : files) {
    const YAML::Node root = ParseYaml(file);
    if (Has(root, "cam0")) {
      result.cameras.reset(root);
      ++of_cameras;
      continue;
    }
    ++of_imus;
    if (!Has(root, "imu0")) result.imus.push_back(root);
    for (int i = 0; Has(root, fmt::format("imu{}", i)); ++i) {
      result.imus.push_back(root[fmt::format("imu{}", i)]);
    }
  }
  const bool maps = std::all_of(result.imus.begin(),
                                result.imus.end(),
                                [](const auto& imu) { return imu.IsMap(); });
  if (of_cameras != 1 || of_imus < 1 || of_imus > imu_files || !maps) {
    throw FormatError(fmt::format(
        "give two files: that of the cameras (cam0, cam1, ...) and that of the "
        "IMU{}",
        imu_files > 1 ? ", or three if each of two IMUs has one" : ""));
  }
  return result;
}

CameraCalibration ReadChainCamera(const YAML::Node& node) {
  CameraCalibration camera;
  ReadIntrinsics(node, &camera);
  const std::vector<int> size = GetInts(node, "resolution", 2);
  camera.width_px = size[0];
  camera.height_px = size[1];
  camera.time_offset_s = GetDouble(node, "timeshift_cam_imu", 0);
  return camera;
}

std::string ChainCameraText(const CameraCalibration& camera) {
  const ToolModel& tool = *FindToolModel(kKalibr, camera.model);
  const DistortionVector& k = camera.distortion;
  std::vector<double> intrinsics(k.begin(), k.begin() + tool.before_pixels);
  intrinsics.insert(intrinsics.end(), camera.f.begin(), camera.f.end());
  intrinsics.insert(intrinsics.end(), camera.c.begin(), camera.c.end());
  return fmt::format(
      "  camera_model: {}\n"
      "  intrinsics: {}\n"
      "  distortion_model: {}\n"
      "  distortion_coeffs: {}\n"
      "  resolution: [{}, {}]\n"
      "  timeshift_cam_imu: {}\n",
      tool.name,
      ListText(intrinsics),
      tool.distortion,
      ListText(std::vector(k.begin() + tool.before_pixels, k.end())),
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

std::string ChainNoiseText(const ImuNoise& noise,
                           int imu,
                           double time_offset_s,
                           double rate_hz,
                           const std::string& indent) {
  return fmt::format(
      "{0}accelerometer_noise_density: {1}\n"
      "{0}accelerometer_random_walk: {2}\n"
      "{0}gyroscope_noise_density: {3}\n"
      "{0}gyroscope_random_walk: {4}\n"
      "{0}update_rate: {5}\n"
      "{0}time_offset: {7}\n"
      "{0}rostopic: /imu{6}\n",
      indent,
      NumberText(noise.accel_noise_density),
      NumberText(noise.accel_bias_random_walk),
      NumberText(noise.gyro_noise_density),
      NumberText(noise.gyro_bias_random_walk),
      NumberText(rate_hz),
      imu,
      NumberText(time_offset_s));
}

}  // namespace selfcal::client
