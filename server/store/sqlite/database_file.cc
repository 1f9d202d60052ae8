#include "server/store/sqlite/database_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

// The file format of SQLite: magic at 0, application id at 68, big-endian.
constexpr std::string_view kMagic("SQLite format 3\0", 16);
constexpr std::size_t kHeaderSize = 100;
constexpr std::size_t kApplicationIdOffset = 68;

absl::Status Refuse(const std::string& path, std::string_view why) {
  return absl::FailedPreconditionError(
      fmt::format("{} {}; it was left as it is. Name another file, or move it "
                  "away",
                  path,
                  why));
}

absl::Status DiskError(const std::string& path, std::string_view what) {
  return absl::UnavailableError(
      fmt::format("cannot {} {}: {}", what, path, std::strerror(errno)));
}

absl::Status Sync(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) {
    return DiskError(path, "open");
  }
  const int result = fsync(file);
  absl::Status status =
      result == 0 ? absl::OkStatus() : DiskError(path, "sync");
  close(file);
  return status;
}

}  // namespace

absl::StatusOr<DatabaseFile> InspectDatabaseFile(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) {
    const fs::path log = path + "-wal";
    if (fs::exists(log, error) && fs::file_size(log, error) > 0) {
      return absl::FailedPreconditionError(fmt::format(
          "{} holds commits of a database {} that is not there; put the "
          "database back beside it, or move it away",
          log.string(),
          path));
    }
    return DatabaseFile::kAbsent;
  }
  if (status.type() != fs::file_type::regular) {
    return Refuse(path, "is not a regular file");
  }
  std::array<char, kHeaderSize> header{};
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    return DiskError(path, "read");
  }
  stream.read(header.data(), header.size());
  if (stream.gcount() < static_cast<std::streamsize>(header.size()) ||
      std::string_view(header.data(), kMagic.size()) != kMagic) {
    return Refuse(path, "is not an SQLite database");
  }
  std::uint32_t id = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    id = id << 8 | static_cast<unsigned char>(header[kApplicationIdOffset + k]);
  }
  if (id != static_cast<std::uint32_t>(kApplicationId)) {
    return Refuse(path, "is the database of another program");
  }
  return DatabaseFile::kOurs;
}

absl::Status RenameDurably(const std::string& from, const std::string& to) {
  absl::Status status = Sync(from);
  if (!status.ok()) {
    return status;
  }
  if (std::rename(from.c_str(), to.c_str()) != 0) {
    return DiskError(to, "rename to");
  }
  const fs::path folder = fs::path(to).parent_path();
  return Sync(folder.empty() ? "." : folder.string());
}

absl::Status RemoveDatabaseFiles(const std::string& path) {
  for (const char* suffix : {"", "-journal", "-wal", "-shm"}) {
    const std::string name = path + suffix;
    if (unlink(name.c_str()) != 0 && errno != ENOENT) {
      return DiskError(name, "remove");
    }
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
