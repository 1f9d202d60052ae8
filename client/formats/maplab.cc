#include "client/formats/maplab.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"

namespace selfcal::client {
namespace {

ImuNoise ReadNoise(const YAML::Node& imu) {
  const YAML::Node sigmas = Get(imu, "sigmas");
  return {.gyro_noise_density = GetDouble(sigmas, "gyro_noise_density"),
          .accel_noise_density = GetDouble(sigmas, "acc_noise_density"),
          .gyro_bias_random_walk =
              GetDouble(sigmas, "gyro_bias_random_walk_noise_density"),
          .accel_bias_random_walk =
              GetDouble(sigmas, "acc_bias_random_walk_noise_density")};
}

// maplab requires a range, and most files have its default, which says nothing
// about the sensor.
ImuFullScale ReadFullScale(const YAML::Node& imu) {
  const auto read = [&](const char* key, double maplab, double selfcal) {
    const double range = GetDouble(imu, key, maplab);
    return range > 0 && range != maplab ? range : selfcal;
  };
  const ImuFullScale defaults;
  return {
      .gyro_radps = read("saturation_gyro_max_radps", 7.5, defaults.gyro_radps),
      .accel_mps2 =
          read("saturation_accel_max_mps2", 150, defaults.accel_mps2)};
}

CameraCalibration ReadCamera(const YAML::Node& entry) {
  const YAML::Node camera = Get(entry, "camera");
  CameraCalibration result;
  const bool distorts = Has(camera, "distortion");
  const std::string projection =
      Has(camera, "type") ? GetText(camera, "type") : "pinhole";
  const std::string type = distorts ? GetText(Get(camera, "distortion"), "type")
                                    : "radial-tangential";
  const auto found =
      FindModel("maplab", projection, type, [](const auto&) { return true; });
  if (!found) {
    throw FormatError(
        fmt::format("distortion type '{}' of a camera of type '{}' is not one "
                    "of {}",
                    type,
                    projection,
                    ToolModelNames("maplab")));
  }
  result.model = found->model;
  const int before = found->tool->before_pixels;
  const int size = DistortionSize(result.model);
  const Eigen::VectorXd intrinsics =
      GetMatrixData(camera, "intrinsics", before + 4, 1);
  result.f = intrinsics.segment<2>(before);
  result.c = intrinsics.tail<2>();
  result.distortion.setZero(size);
  result.distortion.head(before) = intrinsics.head(before);
  if (distorts) {
    result.distortion.tail(size - before) = GetMatrixData(
        Get(camera, "distortion"), "parameters", size - before, 1);
  }
  result.width_px = GetInt(camera, "image_width");
  result.height_px = GetInt(camera, "image_height");
  const auto rigid = [&](const char* key) -> Eigen::Matrix4d {
    return Rigid(GetMatrixData(entry, key, 4, 4), key);
  };
  const Eigen::Matrix4d T_CB =
      Has(entry, "T_C_B") ? rigid("T_C_B") : RigidInverse(rigid("T_B_C"));
  SetTransformFromBody(T_CB, Eigen::Matrix3d::Identity(), &result);
  // Zero is a global shutter.
  const double line_delay_ns = GetDouble(camera, "line-delay-nanoseconds", 0);
  if (line_delay_ns != 0) result.line_delay_s = line_delay_ns / kNsPerS;
  return result;
}

// maplab projects into the cameras of a map with T_B_C only, and ignores the
// extrinsics of the camera system.
void AddExtrinsicsLoss(const YAML::Node& root,
                       const YAML::Node& system,
                       std::vector<Loss>* losses) {
  if (!Has(root, "extrinsics") || !Has(system, "id")) return;
  for (const YAML::Node& entry : root["extrinsics"]) {
    if (GetText(entry, "sensor_id") != GetText(system, "id") ||
        GetMatrixData(entry, "T_B_S", 4, 4).isIdentity(0)) {
      continue;
    }
    losses->push_back({"extrinsics",
                       "T_B_S of the camera system is not used: maplab "
                       "projects with T_B_C only",
                       false});
  }
}

// The first sensor of a type, and a loss if there are others: `second` is the
// name of what is lost.
YAML::Node FirstSensor(const YAML::Node& root,
                       const std::string& type,
                       const std::string& second,
                       std::vector<Loss>* losses) {
  std::vector<YAML::Node> found;
  for (const YAML::Node& sensor : Get(root, "sensors")) {
    if (GetText(sensor, "sensor_type") == type) found.push_back(sensor);
  }
  if (found.empty()) {
    throw FormatError("there is no sensor of type " + type);
  }
  if (found.size() > 1) {
    losses->push_back({second,
                       fmt::format("there are {} sensors of type {}, of which "
                                   "the first is read: omitted",
                                   found.size(),
                                   type),
                       true});
  }
  return found.front();
}

// An id of 32 hexadecimal digits: a hash of the text (FNV-1a).
std::string SensorId(const std::string& text) {
  std::uint64_t halves[2] = {14695981039346656037ull, 1099511628211ull};
  for (std::uint64_t& hash : halves) {
    for (const char c : text) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
    }
  }
  return fmt::format("{:016x}{:016x}", halves[0], halves[1]);
}

std::string ImuText(const Rig& rig, const std::string& id) {
  const ImuNoise& noise = rig.imu_noise;
  return fmt::format(
      "  - id: {}\n"
      "    topic: /imu0\n"
      "    description: \"IMU\"\n"
      "    sensor_type: IMU\n"
      "    sigmas:\n"
      "      acc_noise_density: {}\n"
      "      acc_bias_random_walk_noise_density: {}\n"
      "      gyro_noise_density: {}\n"
      "      gyro_bias_random_walk_noise_density: {}\n"
      "    saturation_accel_max_mps2: {}\n"
      "    saturation_gyro_max_radps: {}\n"
      "    gravity_magnitude_mps2: {}\n",
      id,
      NumberText(noise.accel_noise_density),
      NumberText(noise.accel_bias_random_walk),
      NumberText(noise.gyro_noise_density),
      NumberText(noise.gyro_bias_random_walk),
      NumberText(rig.imu_full_scale.accel_mps2),
      NumberText(rig.imu_full_scale.gyro_radps),
      NumberText(rig.gravity_mps2));
}

std::string CameraText(const CameraCalibration& camera,
                       const std::string& id,
                       std::size_t number) {
  const ToolModel& tool = *FindToolModel("maplab", camera.model);
  const DistortionVector& k = camera.distortion;
  std::vector<double> intrinsics(k.begin(), k.begin() + tool.before_pixels);
  intrinsics.insert(intrinsics.end(), camera.f.begin(), camera.f.end());
  intrinsics.insert(intrinsics.end(), camera.c.begin(), camera.c.end());
  const std::vector<double> parameters(k.begin() + tool.before_pixels, k.end());
  const Eigen::Matrix4d T_BC =
      RigidInverse(TransformFromBody(camera, Eigen::Matrix3d::Identity()));
  return fmt::format(
      "      - camera:\n"
      "          id: {}\n"
      "          sensor_type: CAMERA\n"
      "          description: \"cam{}\"\n"
      "          topic: /cam{}/image_raw\n"
      "          line-delay-nanoseconds: {}\n"
      "          image_height: {}\n"
      "          image_width: {}\n"
      "          type: {}\n"
      "          intrinsics:\n"
      "            cols: 1\n            rows: {}\n            data: {}\n"
      "          distortion:\n"
      "            type: {}\n"
      "            parameters:\n"
      "              cols: 1\n              rows: {}\n              data: {}\n"
      "        T_B_C:\n"
      "          cols: 4\n          rows: 4\n          data:\n{}",
      id,
      number,
      number,
      std::llround(camera.line_delay_s.value_or(0) * kNsPerS),
      camera.height_px,
      camera.width_px,
      tool.name,
      intrinsics.size(),
      ListText(intrinsics),
      tool.distortion,
      parameters.size(),
      ListText(parameters),
      RowsText(T_BC, "            "));
}

std::string PlaceText(const std::string& sensor, const std::string& base) {
  return fmt::format(
      "  - sensor_id: {}\n"
      "    base_sensor_id: {}\n"
      "    T_B_S:\n      cols: 4\n      rows: 4\n      data:\n{}",
      sensor,
      base,
      RowsText(Eigen::Matrix4d::Identity(), "        "));
}

// Values at which maplab's loader stops.
void CheckValues(const Rig& rig,
                 const std::vector<CameraCalibration>& cameras) {
  if (!(rig.gravity_mps2 >= 9 && rig.gravity_mps2 <= 10)) {
    throw FormatError(fmt::format(
        "the rig has a gravity of {} m/s^2, and maplab accepts 9 to 10",
        rig.gravity_mps2));
  }
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    const CameraCalibration& camera = cameras[j];
    if (!(camera.c.minCoeff() > 0)) {
      throw FormatError(
          fmt::format("cam{} has a principal point at {}, {} px, which maplab "
                      "does not accept: it must be above 0",
                      j,
                      camera.c.x(),
                      camera.c.y()));
    }
    const double first = camera.distortion[0];
    if (camera.model == DistortionModel::kFov &&
        !(first >= 0.5 && first <= 1.5)) {
      throw FormatError(fmt::format(
          "cam{} has w = {}, and maplab's fisheye accepts 0.5 to 1.5",
          j,
          first));
    }
    if (FindToolModel("maplab", camera.model)->before_pixels > 0 &&
        !(first >= 0)) {
      throw FormatError(fmt::format(
          "cam{} has xi = {}, and maplab does not accept negative ones",
          j,
          first));
    }
  }
}

}  // namespace

ImportedRig ImportMaplab(const std::vector<TextFile>& files,
                         const FormatOptions&) {
  if (files.size() != 1) throw FormatError("give one file");
  const YAML::Node root = ParseYaml(files[0]);
  ImportedRig result;
  const YAML::Node imu = FirstSensor(root, "IMU", "imu1", &result.losses);
  const YAML::Node system =
      FirstSensor(root, "NCAMERA", "ncamera1", &result.losses);
  result.rig.imu_noise = ReadNoise(imu);
  result.rig.imu_full_scale = ReadFullScale(imu);
  result.rig.gravity_mps2 = GetDouble(imu, "gravity_magnitude_mps2");
  AddExtrinsicsLoss(root, system, &result.losses);
  for (const YAML::Node& entry : Get(system, "cameras")) {
    result.rig.factory.cameras.push_back(ReadCamera(entry));
  }
  return result;
}

ExportedFiles ExportMaplab(const Rig& rig,
                           const Calibration& theta,
                           const FormatOptions&) {
  std::vector<CameraCalibration> cameras = theta.cameras;
  UseModelsOf("maplab", &cameras);
  CheckValues(rig, cameras);
  ExportedFiles result;
  AddPinholeLosses("maplab", cameras, &result.losses);
  const std::string imu = SensorId(rig.id + "/imu");
  const std::string system = SensorId(rig.id + "/cameras");
  std::string text = "sensors:\n" + ImuText(rig, imu);
  text += fmt::format(
      "  - id: {}\n"
      "    topic: \"\"\n"
      "    description: \"cameras\"\n"
      "    sensor_type: NCAMERA\n"
      "    cameras:\n",
      system);
  for (std::size_t j = 0; j < cameras.size(); ++j) {
    text +=
        CameraText(cameras[j], SensorId(fmt::format("{}/cam{}", rig.id, j)), j);
  }
  text += "extrinsics:\n" + PlaceText(imu, imu) + PlaceText(system, imu);
  AddImuLoss("maplab", theta.imu, &result.losses);
  AddTimeOffsetLosses("maplab", theta, &result.losses);
  AddTimeDriftLosses("maplab", theta, &result.losses);
  result.files = {{"sensors.yaml", text}};
  return result;
}

}  // namespace selfcal::client
