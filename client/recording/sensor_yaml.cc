#include "client/recording/sensor_yaml.h"

#include <absl/status/status.h>
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/model/camera_model.h"

namespace selfcal::client {
namespace {

constexpr double kRotationTolerance = 1e-3;

// All of these throw std::runtime_error with the key.
std::vector<double> Numbers(const YAML::Node& node,
                            const std::string& key,
                            std::size_t size) {
  std::vector<double> numbers;
  try {
    numbers = node.as<std::vector<double>>();
  } catch (const YAML::Exception&) {
    throw std::runtime_error(key + " is not a list of numbers");
  }
  if (numbers.size() != size) {
    throw std::runtime_error(fmt::format(
        "{} has {} numbers instead of {}", key, numbers.size(), size));
  }
  for (const double number : numbers) {
    if (!std::isfinite(number)) {
      throw std::runtime_error(key + " has a number that is not finite");
    }
  }
  return numbers;
}

DistortionModel ModelNamed(const std::string& name) {
  for (const DistortionModel model : DistortionModels()) {
    if (DistortionName(model) == name) return model;
  }
  throw std::runtime_error("distortion_model '" + name + "' is not known");
}

// Takes a point from the sensor to the body.
Eigen::Isometry3d PoseInBody(const YAML::Node& yaml) {
  const auto T_BS = Numbers(yaml["T_BS"]["data"], "T_BS", 16);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) pose.matrix()(i, j) = T_BS[4 * i + j];
  }
  const Eigen::Matrix3d R = pose.linear();
  const double off = (R * R.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (off > kRotationTolerance || R.determinant() < 0) {
    throw std::runtime_error("T_BS is not a rotation with a translation");
  }
  return pose;
}

CameraCalibration ParseCamera(const YAML::Node& yaml) {
  CameraCalibration camera;
  const Eigen::Isometry3d T_BC = PoseInBody(yaml);
  camera.q_CI = Eigen::Quaterniond(T_BC.linear()).normalized().conjugate();
  camera.p_CI = -(camera.q_CI * T_BC.translation());
  const auto f_c = Numbers(yaml["intrinsics"], "intrinsics", 4);
  camera.f = {f_c[0], f_c[1]};
  camera.c = {f_c[2], f_c[3]};
  const auto size = Numbers(yaml["resolution"], "resolution", 2);
  camera.width_px = static_cast<int>(size[0]);
  camera.height_px = static_cast<int>(size[1]);
  if (camera.width_px < 1 || camera.height_px < 1) {
    throw std::runtime_error("resolution is not positive");
  }
  camera.model = ModelNamed(yaml["distortion_model"].as<std::string>(""));
  const auto k =
      Numbers(yaml["distortion_coefficients"],
              "distortion_coefficients",
              static_cast<std::size_t>(DistortionSize(camera.model)));
  camera.distortion = Eigen::Map<const Eigen::VectorXd>(
      k.data(), static_cast<Eigen::Index>(k.size()));
  if (yaml["time_offset_s"]) {
    camera.time_offset_s = yaml["time_offset_s"].as<double>();
    if (!std::isfinite(camera.time_offset_s)) {
      throw std::runtime_error("time_offset_s is not finite");
    }
  }
  return camera;
}

ImuYaml ParseImu(const YAML::Node& yaml) {
  ImuYaml imu;
  if (yaml["T_BS"]) imu.T_BI = PoseInBody(yaml);
  ImuNoise noise;
  const std::pair<const char*, double*> densities[] = {
      {"gyroscope_noise_density", &noise.gyro_noise_density},
      {"accelerometer_noise_density", &noise.accel_noise_density},
      {"gyroscope_random_walk", &noise.gyro_bias_random_walk},
      {"accelerometer_random_walk", &noise.accel_bias_random_walk}};
  bool all = true;
  for (const auto& [key, value] : densities) {
    if (!yaml[key]) {
      all = false;
      continue;
    }
    *value = yaml[key].as<double>();
    if (!(*value > 0) || !std::isfinite(*value)) {
      throw std::runtime_error(std::string(key) + " is not positive");
    }
  }
  if (all) imu.noise = noise;
  return imu;
}

// parse(map) for the text of a file; its errors are those of the file.
template <class Parsed>
absl::StatusOr<Parsed> ParseText(const std::string& text,
                                 Parsed (*parse)(const YAML::Node&)) {
  // OpenCV's header is no directive of YAML.
  const std::size_t begin =
      text.starts_with("%YAML:") ? text.find('\n') : std::size_t{0};
  if (begin == std::string::npos) {
    return absl::InvalidArgumentError("there is nothing but a header");
  }
  try {
    const YAML::Node yaml = YAML::Load(text.substr(begin));
    if (!yaml.IsMap()) return absl::InvalidArgumentError("is not a map");
    return parse(yaml);
  } catch (const std::exception& e) {
    return absl::InvalidArgumentError(e.what());
  }
}

}  // namespace

absl::StatusOr<CameraCalibration> ParseCameraYaml(const std::string& text) {
  return ParseText(text, &ParseCamera);
}

absl::StatusOr<ImuYaml> ParseImuYaml(const std::string& text) {
  return ParseText(text, &ParseImu);
}

}  // namespace selfcal::client
