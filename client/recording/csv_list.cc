#include "client/recording/csv_list.h"

#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <string_view>
#include <system_error>

#include "client/recording/order_of_time.h"
#include "core/model/calibration.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

using Cells = std::vector<std::string_view>;

// Longest line, its end included: a file that is no list may have none.
constexpr std::size_t kMaxLine = 4096;

std::string_view Stripped(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") + 1 - begin);
}

Cells SplitLine(std::string_view line) {
  Cells cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    std::size_t end = line.find(',', begin);
    if (end == std::string_view::npos) end = line.size();
    cells.push_back(Stripped(line.substr(begin, end - begin)));
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
  bool any = false;
  int number = 0;
  std::array<char, kMaxLine> buffer;
  const auto fail = [&](const std::string& what) {
    return absl::InvalidArgumentError(
        fmt::format("{}: line {}: {}", path.string(), number, what));
  };
  while (file.getline(buffer.data(), buffer.size())) {
    ++number;
    const std::string_view line = Stripped(buffer.data());
    if (line.empty() || line[0] == '#') continue;
    if (number == 1 && absl::ascii_isalpha(line[0])) continue;
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
    if (const std::string wrong = read(t_ns, cells); !wrong.empty()) {
      return fail(wrong);
    }
    any = true;
  }
  if (file.bad()) {
    return absl::DataLossError(
        fmt::format("{}: cannot be read to its end", path.string()));
  }
  if (!file.eof()) {
    ++number;
    return fail(fmt::format("longer than {} characters", kMaxLine - 1));
  }
  if (!any) {
    return absl::InvalidArgumentError(
        fmt::format("{}: lists nothing", path.string()));
  }
  return absl::OkStatus();
}

bool IsFile(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

absl::StatusOr<ListedImages> ReadImageCsv(const fs::path& path,
                                          const fs::path& folder,
                                          std::vector<std::string>* problems) {
  ListedImages listed;
  std::size_t missing = 0;
  std::string first_missing;
  const absl::Status read = ReadList(
      path, 2, [&](std::int64_t t_ns, const Cells& cells) -> std::string {
        if (cells[1].empty()) return "has no file name";
        const std::string file = folder / std::string(cells[1]);
        if (IsFile(file)) {
          listed.paths.push_back(file);
        } else if (IsFile(file + ".png")) {
          listed.paths.push_back(file + ".png");
        } else {
          if (missing++ == 0) first_missing = file;
          return {};
        }
        listed.times_ns.push_back(t_ns);
        return {};
      });
  if (!read.ok()) return read;
  if (missing > 0) {
    const std::string sentence =
        fmt::format("{}: {} of {} images are missing, {} first",
                    path.string(),
                    missing,
                    missing + listed.paths.size(),
                    first_missing);
    if (listed.paths.empty()) return absl::NotFoundError(sentence);
    problems->push_back(sentence);
  }
  ListedImages sorted;
  for (const std::size_t k :
       OrderOfTime(listed.times_ns, path.string(), "images", problems)) {
    sorted.times_ns.push_back(listed.times_ns[k]);
    sorted.paths.push_back(std::move(listed.paths[k]));
  }
  return sorted;
}

absl::StatusOr<std::vector<ImuSample>> ReadImuCsv(
    const fs::path& path, std::vector<std::string>* problems) {
  std::vector<ImuSample> imu;
  const absl::Status read = ReadList(
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
        imu.push_back(sample);
        return {};
      });
  if (!read.ok()) return read;
  SortByTime(path.string(), &imu, problems);
  return imu;
}

absl::Status ReadImuLists(const fs::path& first,
                          const fs::path& second,
                          RecordedData* data) {
  auto imu = ReadImuCsv(first, &data->problems);
  if (!imu.ok()) return imu.status();
  data->imu = *std::move(imu);
  if (!IsFile(second)) return absl::OkStatus();
  auto imu1 = ReadImuCsv(second, &data->problems);
  if (!imu1.ok()) return imu1.status();
  data->imu1 = *std::move(imu1);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ListedPoint>> ReadTrackCsv(const fs::path& path) {
  std::vector<ListedPoint> points;
  const absl::Status read = ReadList(
      path, 5, [&](std::int64_t t_ns, const Cells& cells) -> std::string {
        ListedPoint listed;
        listed.t_ns = t_ns;
        if (!ParseNumber(cells[1], &listed.camera) || listed.camera < 0 ||
            listed.camera >= kMaxCameras) {
          return fmt::format("the camera '{}' is not a number from 0 to {}",
                             cells[1].substr(0, 40),
                             kMaxCameras - 1);
        }
        if (!ParseNumber(cells[2], &listed.point.landmark)) {
          return fmt::format("the landmark '{}' is not a whole number",
                             cells[2].substr(0, 40));
        }
        for (int i = 0; i < 2; ++i) {
          double& z = listed.point.z_px[i];
          if (!ParseNumber(cells[3 + i], &z) || !std::isfinite(z)) {
            return fmt::format("the pixel '{}' is not a finite number",
                               cells[3 + i].substr(0, 40));
          }
        }
        points.push_back(listed);
        return {};
      });
  if (!read.ok()) return read;
  return points;
}

}  // namespace selfcal::client
