#include "client/recording/message_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/recording/input_file.h"
#include "client/recording/mcap_file.h"
#include "client/recording/ros1_bag.h"
#include "client/recording/sqlite_bag.h"

namespace selfcal::client {
namespace {

constexpr std::uint64_t kMagicBytes = 16;
constexpr std::string_view kRos1Bag = "#ROSBAG V2.0\n";
constexpr std::string_view kOldRos1Bag = "#ROSBAG V1.";
constexpr std::string_view kMcap("\x89MCAP0\r\n", 8);
constexpr std::string_view kSqlite("SQLite format 3\0", 16);
constexpr std::string_view kZstd = "\x28\xb5\x2f\xfd";

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
  std::string magic;
  const absl::Status read =
      (*file)->ReadAt(0, std::min((*file)->size(), kMagicBytes), &magic);
  if (!read.ok()) return read;
  if (magic.starts_with(kRos1Bag)) {
    return MakeRos1Bag(*std::move(file), kRos1Bag.size());
  }
  if (magic.starts_with(kMcap)) {
    return MakeMcapFile(*std::move(file), kMcap.size());
  }
  if (magic.starts_with(kSqlite)) return OpenSqliteBag(path);
  if (magic.starts_with(kOldRos1Bag)) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: a bag of version 1: only version 2.0, of 2010, is read", path));
  }
  if (magic.starts_with(kZstd)) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: compressed as a whole: decompress it with `zstd -d`", path));
  }
  return absl::InvalidArgumentError(
      fmt::format("{}: not a recording: neither a bag of ROS 1 nor MCAP nor "
                  "SQLite",
                  path));
}

}  // namespace selfcal::client
