#include "client/recording/recording.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <system_error>

#include "client/recording/bag_files.h"
#include "client/recording/bag_recording.h"
#include "client/recording/csv_folder.h"
#include "client/recording/euroc_folder.h"

namespace selfcal::client {

namespace fs = std::filesystem;

absl::StatusOr<GreyPixels> Recording::Checked(absl::StatusOr<GreyPixels> pixels,
                                              const std::string& where,
                                              int j) const {
  if (!pixels.ok()) {
    return absl::Status(
        pixels.status().code(),
        fmt::format("{}: {}", where, std::string(pixels.status().message())));
  }
  const RecordedCamera& camera = cameras()[static_cast<std::size_t>(j)];
  if (!camera.calibration) return pixels;
  const CameraCalibration& c = *camera.calibration;
  if (pixels->width_px != c.width_px || pixels->height_px != c.height_px) {
    return absl::DataLossError(
        fmt::format("{}: {} x {} px instead of the {} x {} of {}",
                    where,
                    pixels->width_px,
                    pixels->height_px,
                    c.width_px,
                    c.height_px,
                    camera.name));
  }
  return pixels;
}

std::vector<ImageSet> ImageSets(const Recording& recording) {
  std::map<std::int64_t, std::vector<int>> by_time;
  const std::size_t cameras = recording.cameras().size();
  for (std::size_t j = 0; j < cameras; ++j) {
    const auto& times_ns = recording.cameras()[j].image_times_ns;
    for (std::size_t k = 0; k < times_ns.size(); ++k) {
      std::vector<int>& set = by_time[times_ns[k]];
      if (set.empty()) set.assign(cameras, -1);
      set[j] = static_cast<int>(k);
    }
  }
  std::vector<ImageSet> sets;
  for (auto& [t_ns, images] : by_time) sets.push_back({t_ns, images});
  return sets;
}

absl::StatusOr<std::unique_ptr<Recording>> OpenRecording(
    const std::string& path, const RecordingOptions& options) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return absl::NotFoundError(
        fmt::format("{}: there is no such file or folder", path));
  }
  if (!fs::is_directory(status)) return OpenBag(path, options);
  // The images of a list may be in a folder cam0, which EuRoC's format has,
  // too.
  if (IsCsvFolder(path)) return OpenCsvFolder(path);
  if (IsEurocFolder(path)) return OpenEurocFolder(path);
  if (IsBagFolder(path)) return OpenBag(path, options);
  return absl::InvalidArgumentError(fmt::format(
      "{}: not a recording: the folder has neither mav0 nor cam0.csv nor a bag",
      path));
}

}  // namespace selfcal::client
