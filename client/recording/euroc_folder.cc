#include "client/recording/euroc_folder.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>

#include "client/recording/sensor_yaml.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

using Cells = std::vector<std::string_view>;

Cells SplitLine(std::string_view line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) {
    line.remove_suffix(1);
  }
  Cells cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    std::size_t end = line.find(',', begin);
    if (end == std::string_view::npos) end = line.size();
    std::string_view cell = line.substr(begin, end - begin);
    while (!cell.empty() && cell.front() == ' ') cell.remove_prefix(1);
    cells.push_back(cell);
    begin = end + 1;
  }
  return cells;
}

template <typename T>
bool ParseNumber(std::string_view text, T* value) {
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

// Calls read(t_ns, cells) for each line of a list, which returns what is wrong
// with it, or nothing.
absl::Status ReadList(
    const fs::path& path,
    std::size_t columns,
    const std::function<std::string(std::int64_t, const Cells&)>& read) {
  std::ifstream file(path);
  if (!file) {
    return absl::NotFoundError(
        fmt::format("{}: cannot be opened", path.string()));
  }
  std::int64_t last_ns = 0;
  bool any = false;
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    const auto fail = [&](const std::string& what) {
      return absl::InvalidArgumentError(
          fmt::format("{}: line {}: {}", path.string(), number, what));
    };
    const Cells cells = SplitLine(line);
    if (cells.size() < columns) {
      return fail(
          fmt::format("{} values instead of {}", cells.size(), columns));
    }
    std::int64_t t_ns = 0;
    if (!ParseNumber(cells[0], &t_ns)) {
      return fail(fmt::format("the timestamp '{}' is not a number of ns",
                              cells[0].substr(0, 40)));
    }
    if (any && t_ns <= last_ns) {
      return fail(fmt::format(
          "the timestamp {} is not later than {} before it", t_ns, last_ns));
    }
    if (const std::string wrong = read(t_ns, cells); !wrong.empty()) {
      return fail(wrong);
    }
    last_ns = t_ns;
    any = true;
  }
  if (file.bad()) {
    return absl::DataLossError(
        fmt::format("{}: cannot be read to its end", path.string()));
  }
  if (!any) {
    return absl::InvalidArgumentError(
        fmt::format("{}: lists nothing", path.string()));
  }
  return absl::OkStatus();
}

absl::Status ReadImuList(const fs::path& path, std::vector<ImuSample>* imu) {
  return ReadList(
      path, 7, [&](std::int64_t t_ns, const Cells& cells) -> std::string {
        ImuSample sample;
        sample.t_ns = t_ns;
        for (std::size_t i = 0; i < 6; ++i) {
          double value = 0;
          if (!ParseNumber(cells[1 + i], &value) || !std::isfinite(value)) {
            return fmt::format("the reading '{}' is not a finite number",
                               cells[1 + i].substr(0, 40));
          }
          (i < 3 ? sample.gyro : sample.accel)[static_cast<int>(i % 3)] = value;
        }
        imu->push_back(sample);
        return {};
      });
}

absl::StatusOr<EurocCamera> ReadCamera(const fs::path& folder,
                                       std::vector<std::string>* problems) {
  std::size_t missing = 0;
  std::string first_missing;
  EurocCamera camera;
  camera.name = folder.filename();
  const absl::Status listed =
      ReadList(folder / "data.csv",
               2,
               [&](std::int64_t t_ns, const Cells& cells) -> std::string {
                 const fs::path path = folder / "data" / std::string(cells[1]);
                 if (fs::is_regular_file(path)) {
                   camera.images.push_back({t_ns, path});
                 } else if (missing++ == 0) {
                   first_missing = path;
                 }
                 return {};
               });
  if (!listed.ok()) return listed;
  if (missing > 0) {
    const std::string sentence =
        fmt::format("{}: {} of {} images are missing, {} first",
                    (folder / "data.csv").string(),
                    missing,
                    missing + camera.images.size(),
                    first_missing);
    if (camera.images.empty()) return absl::NotFoundError(sentence);
    problems->push_back(sentence);
  }
  const fs::path yaml = folder / "sensor.yaml";
  if (!fs::exists(yaml)) return camera;
  std::ifstream file(yaml);
  auto parsed = ParseCameraYaml({std::istreambuf_iterator<char>(file), {}});
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: {}", yaml.string(), std::string(parsed.status().message())));
  }
  camera.calibration = *parsed;
  return camera;
}

}  // namespace

absl::StatusOr<EurocRecording> OpenEuroc(const std::string& folder) {
  fs::path root = folder;
  if (fs::is_directory(root / "mav0")) root /= "mav0";
  EurocRecording recording;
  for (int j = 0; fs::is_directory(root / fmt::format("cam{}", j)); ++j) {
    auto camera =
        ReadCamera(root / fmt::format("cam{}", j), &recording.problems);
    if (!camera.ok()) return camera.status();
    recording.cameras.push_back(*std::move(camera));
  }
  if (recording.cameras.empty()) {
    return absl::NotFoundError(
        fmt::format("{}: there is no folder cam0", root.string()));
  }
  const absl::Status read =
      ReadImuList(root / "imu0" / "data.csv", &recording.imu);
  if (!read.ok()) return read;
  return recording;
}

absl::StatusOr<GreyPixels> ReadImage(const EurocCamera& camera,
                                     const EurocImage& image) {
  auto pixels = ReadPng(image.path);
  if (!pixels.ok() || !camera.calibration) return pixels;
  const CameraCalibration& c = *camera.calibration;
  if (pixels->width_px != c.width_px || pixels->height_px != c.height_px) {
    return absl::DataLossError(
        fmt::format("{}: {} x {} px instead of the {} x {} of {}",
                    image.path,
                    pixels->width_px,
                    pixels->height_px,
                    c.width_px,
                    c.height_px,
                    camera.name));
  }
  return pixels;
}

std::vector<ImageSet> ImageSets(const EurocRecording& recording) {
  std::map<std::int64_t, std::vector<int>> by_time;
  const std::size_t cameras = recording.cameras.size();
  for (std::size_t j = 0; j < cameras; ++j) {
    const std::vector<EurocImage>& images = recording.cameras[j].images;
    for (std::size_t k = 0; k < images.size(); ++k) {
      std::vector<int>& set = by_time[images[k].t_ns];
      if (set.empty()) set.assign(cameras, -1);
      set[j] = static_cast<int>(k);
    }
  }
  std::vector<ImageSet> sets;
  for (auto& [t_ns, images] : by_time) sets.push_back({t_ns, images});
  return sets;
}

}  // namespace selfcal::client
