#include "client/recording/euroc_folder.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
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
  const fs::path yaml = folder / "sensor.yaml";
  std::error_code error;
  if (fs::exists(yaml, error)) {
    std::ifstream file(yaml);
    auto parsed = ParseCameraYaml({std::istreambuf_iterator<char>(file), {}});
    if (!parsed.ok()) {
      return absl::InvalidArgumentError(fmt::format(
          "{}: {}", yaml.string(), std::string(parsed.status().message())));
    }
    camera.calibration = *parsed;
    camera.has_pose = true;
  }
  data->cameras.push_back(std::move(camera));
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
  auto imu = ReadImuCsv(root / "imu0" / "data.csv", &data.problems);
  if (!imu.ok()) return imu.status();
  data.imu = *std::move(imu);
  return std::make_unique<ImageFileRecording>(std::move(data),
                                              std::move(paths));
}

}  // namespace selfcal::client
