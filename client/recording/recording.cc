#include "client/recording/recording.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <tuple>

#include "client/recording/bag_files.h"
#include "client/recording/bag_recording.h"
#include "client/recording/csv_folder.h"
#include "client/recording/euroc_folder.h"
#include "client/recording/track_folder.h"
#include "core/model/median.h"

namespace selfcal::client {

namespace fs = std::filesystem;

void Recording::ShiftReadings(std::int64_t by_ns) {
  for (std::vector<ImuSample>* samples : {&data_.imu, &data_.imu1}) {
    for (ImuSample& sample : *samples) sample.t_ns += by_ns;
  }
}

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
  struct Image {
    std::int64_t t_ns;
    std::size_t camera;
    int index;
  };
  const std::size_t cameras = recording.cameras().size();
  std::vector<Image> all;
  for (std::size_t j = 0; j < cameras; ++j) {
    const auto& times_ns = recording.cameras()[j].image_times_ns;
    for (std::size_t k = 0; k < times_ns.size(); ++k) {
      all.push_back({times_ns[k], j, static_cast<int>(k)});
    }
  }
  std::sort(all.begin(), all.end(), [](const Image& a, const Image& b) {
    return std::tie(a.t_ns, a.camera) < std::tie(b.t_ns, b.camera);
  });
  constexpr auto kSameTime_ns = static_cast<std::int64_t>(1e9 * kSameTime_s);
  std::vector<ImageSet> sets;
  for (const Image& image : all) {
    if (sets.empty() || image.t_ns - sets.back().t_ns > kSameTime_ns ||
        sets.back().images[image.camera] >= 0) {
      sets.push_back({image.t_ns, std::vector<int>(cameras, -1)});
    }
    sets.back().images[image.camera] = image.index;
  }
  return sets;
}

std::optional<std::string> StampDifferences(const Recording& recording) {
  std::vector<double> differences_ms;
  for (const ImageSet& set : ImageSets(recording)) {
    std::int64_t last_ns = set.t_ns;
    int images = 0;
    for (std::size_t j = 0; j < set.images.size(); ++j) {
      if (set.images[j] < 0) continue;
      ++images;
      last_ns = std::max(last_ns,
                         recording.cameras()[j].image_times_ns[set.images[j]]);
    }
    if (images > 1) {
      differences_ms.push_back(1e-6 * static_cast<double>(last_ns - set.t_ns));
    }
  }
  if (differences_ms.empty()) return std::nullopt;
  const double most_ms =
      *std::max_element(differences_ms.begin(), differences_ms.end());
  if (most_ms == 0) return std::nullopt;
  return fmt::format(
      "the images of one time have stamps that differ by {:.3f} ms (median), "
      "at most {:.3f} ms: they count as exposed together, at the earliest "
      "stamp",
      UpperMedian(std::move(differences_ms)),
      most_ms);
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
  if (IsTrackFolder(path)) return OpenTrackFolder(path);
  if (IsCsvFolder(path)) return OpenCsvFolder(path);
  if (IsEurocFolder(path)) return OpenEurocFolder(path);
  if (IsBagFolder(path)) return OpenBag(path, options);
  return absl::InvalidArgumentError(
      fmt::format("{}: not a recording: the folder has neither mav0 nor "
                  "cam0.csv nor tracks.csv nor a bag",
                  path));
}

}  // namespace selfcal::client
