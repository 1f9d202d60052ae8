#include "client/recording/csv_folder.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "client/recording/csv_list.h"
#include "client/recording/image_files.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

bool IsCsvFolder(const std::string& path) {
  return IsFile(fs::path(path) / "cam0.csv");
}

absl::StatusOr<std::unique_ptr<Recording>> OpenCsvFolder(
    const std::string& folder) {
  const fs::path root = folder;
  RecordedData data;
  ImagePaths paths;
  for (int j = 0; IsFile(root / fmt::format("cam{}.csv", j)); ++j) {
    RecordedCamera camera;
    camera.name = fmt::format("cam{}", j);
    auto listed =
        ReadImageCsv(root / (camera.name + ".csv"), root, &data.problems);
    if (!listed.ok()) return listed.status();
    camera.image_times_ns = std::move(listed->times_ns);
    paths.push_back(std::move(listed->paths));
    data.cameras.push_back(std::move(camera));
  }
  const absl::Status read =
      ReadImuLists(root / "imu.csv", root / "imu1.csv", &data);
  if (!read.ok()) return read;
  return std::make_unique<ImageFileRecording>(std::move(data),
                                              std::move(paths));
}

}  // namespace selfcal::client
