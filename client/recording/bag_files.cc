#include "client/recording/bag_files.h"

#include <absl/status/status.h>
#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "client/recording/input_file.h"

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

constexpr char kMetadata[] = "metadata.yaml";
constexpr std::size_t kMaxMetadataBytes = 16 << 20;
constexpr std::string_view kZstdSuffix = ".zstd";

bool Exists(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

std::vector<std::string> MessageFilesIn(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    const fs::path& path = it->path();
    if (path.extension() == ".mcap" || path.extension() == ".db3") {
      files.push_back(path);
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Paths are relative to the folder, or to the one around it in old bags. A file
// that was decompressed beside the original takes its place.
std::string FileOf(const fs::path& folder, const std::string& listed) {
  std::string path = folder / fs::path(listed).filename();
  if (!Exists(path) && Exists(folder / listed)) path = folder / listed;
  if (path.ends_with(kZstdSuffix)) {
    const std::string content =
        path.substr(0, path.size() - kZstdSuffix.size());
    if (Exists(content)) return content;
  }
  return path;
}

absl::StatusOr<std::vector<std::string>> ListedFiles(
    const std::string& folder) {
  const std::string path = fs::path(folder) / kMetadata;
  const auto text = ReadWholeFile(path, kMaxMetadataBytes);
  if (!text.ok()) return text.status();
  try {
    const YAML::Node info = YAML::Load(*text)["rosbag2_bagfile_information"];
    const std::string mode = info["compression_mode"].as<std::string>("");
    if (absl::AsciiStrToLower(mode) == "message") {
      return absl::UnimplementedError(
          fmt::format("{}: its messages are compressed one by one: convert it "
                      "with `ros2 bag convert`",
                      path));
    }
    std::vector<std::string> files;
    for (const YAML::Node& file : info["relative_file_paths"]) {
      files.push_back(FileOf(folder, file.as<std::string>()));
    }
    if (!files.empty()) return files;
    return absl::InvalidArgumentError(fmt::format("{}: lists no file", path));
  } catch (const YAML::Exception& e) {
    return absl::InvalidArgumentError(fmt::format("{}: {}", path, e.what()));
  }
}

absl::StatusOr<std::vector<std::string>> FilesOf(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return std::vector<std::string>{path};
  if (Exists(fs::path(path) / kMetadata)) return ListedFiles(path);
  std::vector<std::string> files = MessageFilesIn(path);
  if (files.size() > 1) {
    return absl::InvalidArgumentError(
        fmt::format("{}: has {} bags and no {}: state the file of one, as {}",
                    path,
                    files.size(),
                    kMetadata,
                    files[0]));
  }
  return files;
}

}  // namespace

bool IsBagFolder(const std::string& path) {
  return Exists(fs::path(path) / kMetadata) || !MessageFilesIn(path).empty();
}

absl::StatusOr<std::vector<std::unique_ptr<MessageFile>>> OpenBagFiles(
    const std::string& path, std::vector<std::string>* problems) {
  const auto paths = FilesOf(path);
  if (!paths.ok()) return paths.status();
  std::vector<std::unique_ptr<MessageFile>> files;
  absl::Status first_failure;
  for (const std::string& each : *paths) {
    auto file = OpenMessageFile(each);
    if (file.ok()) {
      files.push_back(*std::move(file));
      continue;
    }
    first_failure.Update(file.status());
    problems->emplace_back(file.status().message());
  }
  if (files.empty()) return first_failure;
  return files;
}

}  // namespace selfcal::client
