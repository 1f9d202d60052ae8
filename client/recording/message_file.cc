#include "client/recording/message_file.h"

#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <absl/strings/string_view.h>
#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "client/recording/input_file.h"
#include "client/recording/mcap_file.h"
#include "client/recording/ros1_bag.h"
#include "client/recording/sqlite_bag.h"

namespace selfcal::client {
namespace {

constexpr std::uint64_t kHeadBytes = 4096;
constexpr std::string_view kRos1Bag = "#ROSBAG V2.0\n";
constexpr std::string_view kOldRos1Bag = "#ROSBAG V1.";
constexpr std::string_view kMcap("\x89MCAP0\r\n", 8);
constexpr std::string_view kSqlite("SQLite format 3\0", 16);
constexpr std::string_view kZstd = "\x28\xb5\x2f\xfd";

// Trajectories that SLAM systems write (TUM, EuRoC, OpenVINS) are lines of a
// time and a pose, and what else the system estimates: eight numbers or more.
constexpr int kTrajectoryNumbers = 8;

bool IsTrajectory(absl::string_view head) {
  for (const absl::string_view line : absl::StrSplit(head, '\n')) {
    if (absl::StartsWith(line, "#")) continue;
    int numbers = 0;
    for (const absl::string_view field :
         absl::StrSplit(line, absl::ByAnyChar(" ,;\t\r"), absl::SkipEmpty())) {
      double number = 0;
      if (!absl::SimpleAtod(field, &number)) return false;
      ++numbers;
    }
    return numbers >= kTrajectoryNumbers;
  }
  return false;
}

}  // namespace

std::string RosTypeName(std::string_view type) {
  constexpr std::string_view kPart = "/msg/";
  std::string name(type);
  const std::size_t at = name.find(kPart);
  if (at != std::string::npos) name.replace(at, kPart.size(), "/");
  return name;
}

absl::StatusOr<std::unique_ptr<MessageFile>> OpenMessageFile(
    const std::string& path) {
  auto file = InputFile::Open(path);
  if (!file.ok()) return file.status();
  std::string head;
  const absl::Status read =
      (*file)->ReadAt(0, std::min((*file)->size(), kHeadBytes), &head);
  if (!read.ok()) return read;
  if (head.starts_with(kRos1Bag)) {
    return MakeRos1Bag(*std::move(file), kRos1Bag.size());
  }
  if (head.starts_with(kMcap)) {
    return MakeMcapFile(*std::move(file), kMcap.size());
  }
  if (head.starts_with(kSqlite)) return OpenSqliteBag(path);
  if (head.starts_with(kOldRos1Bag)) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: a bag of version 1: only version 2.0, of 2010, is read", path));
  }
  if (head.starts_with(kZstd)) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: compressed as a whole: decompress it with `zstd -d`", path));
  }
  if (IsTrajectory(head)) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: a trajectory, which has neither images nor tracks: name the "
        "recording from which it was estimated",
        path));
  }
  return absl::InvalidArgumentError(
      fmt::format("{}: not a recording: neither a bag of ROS 1 nor MCAP nor "
                  "SQLite",
                  path));
}

}  // namespace selfcal::client
