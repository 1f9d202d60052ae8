// Lists of images and readings as CSV: a time [ns] and what was recorded then,
// a line each. Lines that begin with # are comments, and a first line that
// begins with a letter is a heading.
//
// Errors are NOT_FOUND for a list that is missing, or all images of one,
// INVALID_ARGUMENT with the line for one that cannot be parsed.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "client/recording/recording.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct ListedImages {
  std::vector<std::int64_t> times_ns;  // each later than the one before
  std::vector<std::string> paths;      // of each
};

// Reads lines "time, file name" of files in `folder`; the extension .png may be
// missing. Files that do not exist are left out, with one sentence, as those of
// recordings that were cut.
absl::StatusOr<ListedImages> ReadImageCsv(const std::filesystem::path& path,
                                          const std::filesystem::path& folder,
                                          std::vector<std::string>* problems);

// Reads lines "time, gyroscope x y z [rad/s], accelerometer x y z [m/s^2]".
absl::StatusOr<std::vector<ImuSample>> ReadImuCsv(
    const std::filesystem::path& path, std::vector<std::string>* problems);

// Reads the readings of the IMU into *data, and those of a second one if there
// is a list of them.
absl::Status ReadImuLists(const std::filesystem::path& first,
                          const std::filesystem::path& second,
                          RecordedData* data);

struct ListedPoint {
  std::int64_t t_ns = 0;
  int camera = 0;
  RecordedPoint point;
};

// Reads lines "time, camera, landmark, x, y [px]", in the order of the file.
absl::StatusOr<std::vector<ListedPoint>> ReadTrackCsv(
    const std::filesystem::path& path);

}  // namespace selfcal::client
