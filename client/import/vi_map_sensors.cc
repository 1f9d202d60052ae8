#include "client/import/vi_map_sensors.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <stdexcept>

namespace selfcal::client {
namespace {

// Thrown inside this file only; ParseSensors turns it into a status.
struct SensorsError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

YAML::Node Get(const YAML::Node& node, const std::string& key) {
  if (!node.IsMap() || !node[key]) {
    throw SensorsError(fmt::format("field '{}' is missing", key));
  }
  return node[key];
}

ImuNoise ReadNoise(const YAML::Node& imu) {
  const YAML::Node sigmas = Get(imu, "sigmas");
  return {.gyro_noise_density = Get(sigmas, "gyro_noise_density").as<double>(),
          .accel_noise_density = Get(sigmas, "acc_noise_density").as<double>(),
          .gyro_bias_random_walk =
              Get(sigmas, "gyro_bias_random_walk_noise_density").as<double>(),
          .accel_bias_random_walk =
              Get(sigmas, "acc_bias_random_walk_noise_density").as<double>()};
}

DistortionModel ReadModel(const std::string& type) {
  if (type == "fisheye") return DistortionModel::kFov;
  if (type == "radial-tangential") return DistortionModel::kRadialTangential;
  if (type == "equidistant") return DistortionModel::kEquidistant;
  throw SensorsError(fmt::format(
      "distortion type '{}' is not fisheye, radial-tangential or equidistant",
      type));
}

Eigen::Isometry3d ReadTransform(const YAML::Node& node) {
  const YAML::Node data = Get(node, "data");
  Eigen::Matrix4d T;
  if (data.size() != 4) throw SensorsError("T_B_C needs 4 rows");
  for (int row = 0; row < 4; ++row) {
    if (data[row].size() != 4) throw SensorsError("T_B_C needs 4 columns");
    for (int col = 0; col < 4; ++col) {
      T(row, col) = data[row][col].as<double>();
    }
  }
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3) ||
      !(R.determinant() > 0)) {
    throw SensorsError("T_B_C is not a rigid transform");
  }
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  result.translation() = T.topRightCorner<3, 1>();
  return result;
}

CameraCalibration ReadCamera(const YAML::Node& entry) {
  const YAML::Node camera = Get(entry, "camera");
  const YAML::Node intrinsics = Get(Get(camera, "intrinsics"), "data");
  if (intrinsics.size() != 4) throw SensorsError("intrinsics need 4 numbers");
  const YAML::Node distortion = Get(camera, "distortion");
  const YAML::Node coefficients = Get(Get(distortion, "parameters"), "data");

  CameraCalibration result;
  const Eigen::Isometry3d T_CI = ReadTransform(Get(entry, "T_B_C")).inverse();
  result.q_CI = Eigen::Quaterniond(T_CI.linear()).normalized();
  result.p_CI = T_CI.translation();
  result.f = {intrinsics[0].as<double>(), intrinsics[1].as<double>()};
  result.c = {intrinsics[2].as<double>(), intrinsics[3].as<double>()};
  result.model = ReadModel(Get(distortion, "type").as<std::string>());
  const int size = DistortionSize(result.model);
  if (static_cast<int>(coefficients.size()) != size) {
    throw SensorsError(fmt::format(
        "distortion needs {} coefficients, not {}", size, coefficients.size()));
  }
  result.distortion.resize(size);
  for (int i = 0; i < size; ++i) {
    result.distortion[i] = coefficients[i].as<double>();
  }
  result.width_px = Get(camera, "image_width").as<int>();
  result.height_px = Get(camera, "image_height").as<int>();
  return result;
}

Rig ReadRig(const YAML::Node& root) {
  Rig rig;
  bool has_imu = false;
  for (const YAML::Node& sensor : Get(root, "sensors")) {
    const std::string type = Get(sensor, "sensor_type").as<std::string>();
    if (type == "IMU" && !has_imu) {
      has_imu = true;
      rig.imu_noise = ReadNoise(sensor);
      rig.gravity_mps2 = Get(sensor, "gravity_magnitude_mps2").as<double>();
    } else if (type == "NCAMERA" && rig.factory.cameras.empty()) {
      for (const YAML::Node& entry : Get(sensor, "cameras")) {
        rig.factory.cameras.push_back(ReadCamera(entry));
      }
    }
  }
  if (!has_imu) throw SensorsError("there is no sensor of type IMU");
  if (rig.factory.cameras.empty()) {
    throw SensorsError("there is no sensor of type NCAMERA with a camera");
  }
  return rig;
}

}  // namespace

absl::StatusOr<Rig> ParseSensors(const std::string& text,
                                 const std::string& path) {
  try {
    return ReadRig(YAML::Load(text));
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(
        fmt::format("{}: {}", path, error.what()));
  }
}

}  // namespace selfcal::client
