#include "client/recording/euroc_folder.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "client/recording/csv_list.h"
#include "client/recording/image_files.h"
#include "client/recording/sensor_yaml.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

bool IsFolder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

// The folder of the sensors.
fs::path RootOf(const std::string& folder) {
  const fs::path mav = fs::path(folder) / "mav0";
  return IsFolder(mav) ? mav : fs::path(folder);
}

// Reads the sensor.yaml of a folder; nullopt if there is none.
template <class Stated>
absl::StatusOr<std::optional<Stated>> ReadSensor(
    const fs::path& folder,
    absl::StatusOr<Stated> (*parse)(const std::string&)) {
  const fs::path yaml = folder / "sensor.yaml";
  std::error_code error;
  if (!fs::exists(yaml, error)) return std::optional<Stated>();
  std::ifstream file(yaml);
  auto parsed = parse({std::istreambuf_iterator<char>(file), {}});
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: {}", yaml.string(), std::string(parsed.status().message())));
  }
  return std::optional<Stated>(*std::move(parsed));
}

absl::Status AddCamera(const fs::path& folder,
                       RecordedData* data,
                       ImagePaths* paths) {
  auto listed =
      ReadImageCsv(folder / "data.csv", folder / "data", &data->problems);
  if (!listed.ok()) return listed.status();
  RecordedCamera camera;
  camera.name = folder.filename();
  camera.image_times_ns = std::move(listed->times_ns);
  paths->push_back(std::move(listed->paths));
  const auto stated = ReadSensor(folder, &ParseCameraYaml);
  if (!stated.ok()) return stated.status();
  camera.calibration = *stated;
  camera.has_pose = stated->has_value();
  data->cameras.push_back(std::move(camera));
  return absl::OkStatus();
}

// Poses of cameras are relative to the body until here.
absl::Status DescribeImus(const fs::path& first,
                          const fs::path& second,
                          RecordedData* data) {
  const auto stated = ReadSensor(first, &ParseImuYaml);
  if (!stated.ok()) return stated.status();
  const ImuYaml imu = stated->value_or(ImuYaml());
  data->imu_noise = imu.noise;
  if (!data->imu1.empty()) {
    const auto stated1 = ReadSensor(second, &ParseImuYaml);
    if (!stated1.ok()) return stated1.status();
    if (stated1->has_value()) {
      data->imu1_noise = (*stated1)->noise;
      const Eigen::Isometry3d T_JI = (*stated1)->T_BI.inverse() * imu.T_BI;
      SecondImuCalibration& imu1 = data->imu1_calibration.emplace();
      imu1.q_JI = Eigen::Quaterniond(T_JI.linear()).normalized();
      imu1.p_JI = T_JI.translation();
    }
  }
  if (imu.T_BI.matrix().isIdentity(0)) return absl::OkStatus();
  const Eigen::Quaterniond q_BI =
      Eigen::Quaterniond(imu.T_BI.linear()).normalized();
  for (RecordedCamera& camera : data->cameras) {
    if (!camera.calibration) continue;
    CameraCalibration& c = *camera.calibration;
    c.p_CI += c.q_CI * imu.T_BI.translation();
    c.q_CI = (c.q_CI * q_BI).normalized();
  }
  return absl::OkStatus();
}

}  // namespace

bool IsEurocFolder(const std::string& path) {
  return IsFolder(fs::path(path) / "mav0") ||
         IsFolder(fs::path(path) / "cam0") || IsFolder(fs::path(path) / "imu0");
}

absl::StatusOr<std::unique_ptr<Recording>> OpenEurocFolder(
    const std::string& folder) {
  const fs::path root = RootOf(folder);
  RecordedData data;
  ImagePaths paths;
  for (int j = 0; IsFolder(root / fmt::format("cam{}", j)); ++j) {
    const absl::Status added =
        AddCamera(root / fmt::format("cam{}", j), &data, &paths);
    if (!added.ok()) return added;
  }
  if (data.cameras.empty()) {
    return absl::NotFoundError(
        fmt::format("{}: there is no folder cam0", root.string()));
  }
  const fs::path first = root / "imu0", second = root / "imu1";
  const absl::Status read =
      ReadImuLists(first / "data.csv", second / "data.csv", &data);
  if (!read.ok()) return read;
  const absl::Status described = DescribeImus(first, second, &data);
  if (!described.ok()) return described;
  return std::make_unique<ImageFileRecording>(std::move(data),
                                              std::move(paths));
}

}  // namespace selfcal::client
