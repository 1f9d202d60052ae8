#include "client/formats/vins_fusion.h"

#include <fmt/format.h>

#include "client/formats/format_error.h"
#include "client/formats/imu_matrices.h"
#include "client/formats/losses.h"
#include "client/formats/tool_models.h"
#include "client/formats/yaml_values.h"
#include "core/model/noise_density.h"

namespace selfcal::client {
namespace {

std::string FileName(const std::string& path) {
  return path.substr(path.find_last_of('/') + 1);
}

const TextFile& FindFile(const std::vector<TextFile>& files,
                         const std::string& name) {
  for (const TextFile& file : files) {
    if (FileName(file.name) == FileName(name)) return file;
  }
  throw FormatError(
      fmt::format("its camera file {} is missing: give it as well", name));
}

YAML::Node FindConfiguration(const std::vector<TextFile>& files) {
  for (const TextFile& file : files) {
    const YAML::Node root = ParseYaml(file);
    if (Has(root, "num_of_cam")) return root;
  }
  throw FormatError("no file has num_of_cam: give the configuration as well");
}

CameraCalibration ReadCamera(const TextFile& file) {
  const YAML::Node root = ParseYaml(file);
  const std::string type = GetText(root, "model_type");
  const auto value = [&](const std::string& path) {
    const std::size_t dot = path.find('.');
    return GetDouble(Get(root, path.substr(0, dot)), path.substr(dot + 1));
  };
  const auto found =
      FindModel("vins_fusion", type, {}, [&](const std::string& path) {
        return value(path) == 0;
      });
  if (!found) {
    throw FormatError(fmt::format("{}: model_type '{}' is not one of {}",
                                  file.name,
                                  type,
                                  ToolModelNames("vins_fusion")));
  }
  CameraCalibration camera;
  camera.model = found->model;
  camera.distortion = Undistorted(camera.model);
  const ToolModel& tool = *found->tool;
  const std::vector<std::string> names = Words(tool.coefficients);
  for (std::size_t i = 0; i < names.size(); ++i) {
    camera.distortion[static_cast<Eigen::Index>(i)] = value(names[i]);
  }
  const std::vector<std::string> pixels = Words(tool.pixels);
  camera.f = {value(pixels[0]), value(pixels[1])};
  camera.c = {value(pixels[2]), value(pixels[3])};
  camera.width_px = GetInt(root, "image_width");
  camera.height_px = GetInt(root, "image_height");
  return camera;
}

// Appends the value at a path "section.name"; `section` is that of the one
// before.
void AddValue(const std::string& path,
              double value,
              std::string* section,
              std::string* text) {
  const std::size_t dot = path.find('.');
  if (path.substr(0, dot) != *section) {
    *section = path.substr(0, dot);
    *text += *section + ":\n";
  }
  *text += fmt::format("  {}: {}\n", path.substr(dot + 1), NumberText(value));
}

std::string CameraText(const CameraCalibration& camera) {
  const ToolModel& tool = *FindToolModel("vins_fusion", camera.model);
  std::string text = fmt::format(
      "%YAML:1.0\n---\n"
      "model_type: {}\n"
      "camera_name: camera\n"
      "image_width: {}\n"
      "image_height: {}\n",
      tool.name,
      camera.width_px,
      camera.height_px);
  std::string section;
  const std::vector<std::string> names = Words(tool.coefficients);
  for (std::size_t i = 0; i < names.size(); ++i) {
    AddValue(names[i],
             camera.distortion[static_cast<Eigen::Index>(i)],
             &section,
             &text);
  }
  for (const std::string& zero : Words(tool.zeros)) {
    AddValue(zero, 0, &section, &text);
  }
  const std::vector<std::string> pixels = Words(tool.pixels);
  const Eigen::Vector4d values(
      camera.f.x(), camera.f.y(), camera.c.x(), camera.c.y());
  for (int i = 0; i < 4; ++i) AddValue(pixels[i], values[i], &section, &text);
  return text;
}

void CheckCameras(const std::vector<CameraCalibration>& cameras) {
  for (const CameraCalibration& camera : cameras) {
    if (camera.width_px != cameras[0].width_px ||
        camera.height_px != cameras[0].height_px) {
      throw FormatError("vins_fusion has one image size for both cameras");
    }
  }
}

}  // namespace

ImportedRig ImportVinsFusion(const std::vector<TextFile>& files,
                             const FormatOptions& options) {
  const YAML::Node root = FindConfiguration(files);
  ImportedRig result;
  if (GetInt(root, "imu") != 1) {
    throw FormatError("imu is not 1: the configuration has no IMU");
  }
  const double rate_hz =
      ImuRate(options, "the rate of its noise", &result.losses);
  const auto density = [&](const char* key) {
    return NoiseDensity(GetDouble(root, key), rate_hz);
  };
  result.rig.imu_noise = {.gyro_noise_density = density("gyr_n"),
                          .accel_noise_density = density("acc_n"),
                          .gyro_bias_random_walk = density("gyr_w"),
                          .accel_bias_random_walk = density("acc_w")};
  result.rig.gravity_mps2 = GetDouble(root, "g_norm");
  const int count = GetInt(root, "num_of_cam");
  if (count != 1 && count != 2) throw FormatError("num_of_cam is not 1 or 2");
  for (int j = 0; j < count; ++j) {
    CameraCalibration camera = ReadCamera(
        FindFile(files, GetText(root, fmt::format("cam{}_calib", j))));
    const std::string key = fmt::format("body_T_cam{}", j);
    SetTransformFromBody(
        RigidInverse(Rigid(GetMatrixData(root, key, 4, 4), key)),
        Eigen::Matrix3d::Identity(),
        &camera);
    camera.time_offset_s = GetDouble(root, "td", 0);
    result.rig.factory.cameras.push_back(camera);
  }
  return result;
}

ExportedFiles ExportVinsFusion(const Rig& rig,
                               const Calibration& theta,
                               const FormatOptions& options) {
  ExportedFiles result;
  Calibration kept = theta;
  KeepCameras("vins_fusion", 2, &kept, &result.losses);
  UseModelsOf("vins_fusion", &kept.cameras);
  CheckCameras(kept.cameras);
  const double rate_hz =
      ImuRate(options, "the rate of its noise", &result.losses);
  const ImuNoise& noise = rig.imu_noise;
  std::string text = fmt::format(
      "%YAML:1.0\n---\n"
      "imu: 1\n"
      "num_of_cam: {}\n"
      "image_width: {}\n"
      "image_height: {}\n"
      "acc_n: {}\n"
      "gyr_n: {}\n"
      "acc_w: {}\n"
      "gyr_w: {}\n"
      "g_norm: {}\n"
      "td: {}\n",
      kept.cameras.size(),
      kept.cameras[0].width_px,
      kept.cameras[0].height_px,
      NumberText(ReadingSigma(noise.accel_noise_density, rate_hz)),
      NumberText(ReadingSigma(noise.gyro_noise_density, rate_hz)),
      NumberText(ReadingSigma(noise.accel_bias_random_walk, rate_hz)),
      NumberText(ReadingSigma(noise.gyro_bias_random_walk, rate_hz)),
      NumberText(rig.gravity_mps2),
      NumberText(kept.cameras[0].time_offset_s));
  std::vector<TextFile> cameras;
  for (std::size_t j = 0; j < kept.cameras.size(); ++j) {
    const std::string name = fmt::format("cam{}.yaml", j);
    const Eigen::Matrix4d T_BC = RigidInverse(
        TransformFromBody(kept.cameras[j], Eigen::Matrix3d::Identity()));
    text += fmt::format("cam{}_calib: \"{}\"\n", j, name);
    text += fmt::format("body_T_cam{}: {}", j, OpenCvMatrixText(T_BC, 'd'));
    cameras.push_back({name, CameraText(kept.cameras[j])});
  }
  // Its tracker divides rays by their distance along the axis.
  AddPinholeLosses(
      "vins_fusion", kept.cameras, &result.losses, {"KANNALA_BRANDT", "MEI"});
  AddImuLoss("vins_fusion", theta.imu, &result.losses);
  AddSharedOffsetLosses("vins_fusion", kept, &result.losses);
  AddLineDelayLosses("vins_fusion", kept, &result.losses);
  AddTimeDriftLosses("vins_fusion", kept, &result.losses);
  result.losses.push_back(
      {"settings",
       "those of its tracker, solver and topics are not part of a calibration: "
       "insert these lines into your file",
       false});
  result.files = {{"vins_fusion.yaml", text}};
  result.files.insert(result.files.end(), cameras.begin(), cameras.end());
  return result;
}

}  // namespace selfcal::client
