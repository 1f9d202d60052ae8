#include "client/cli/new_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace selfcal::client {
namespace {

namespace fs = std::filesystem;

absl::Status Exists(const std::string& path) {
  return absl::AlreadyExistsError(fmt::format(
      "{} exists: name another file, or overwrite it with --force", path));
}

bool SyncFolderOf(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  const int handle = open(folder.empty() ? "." : folder.c_str(),
                          O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return false;
  // EINVAL: the file system cannot sync folders.
  const bool synced = fsync(handle) == 0 || errno == EINVAL;
  close(handle);
  return synced;
}

}  // namespace

NewFile::~NewFile() {
  if (file_ >= 0) close(file_);
  if (!unfinished_.empty()) unlink(unfinished_.c_str());
}

absl::Status NewFile::Failed(std::string_view what) const {
  return absl::FailedPreconditionError(
      fmt::format("cannot {} {}: {}",
                  what,
                  path_,
                  std::error_code(errno, std::generic_category()).message()));
}

absl::Status NewFile::Open(const std::string& path, bool overwrite) {
  path_ = path;
  overwrite_ = overwrite;
  std::error_code error;
  const fs::file_status there = fs::symlink_status(path, error);
  if (fs::exists(there)) {
    if (!fs::is_regular_file(there)) {
      return absl::FailedPreconditionError(
          fmt::format("{} is not a regular file: name another", path));
    }
    if (!overwrite) return Exists(path);
  }
  std::string name = path + ".XXXXXX";
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) return Failed("write");
  unfinished_ = name;
  return absl::OkStatus();
}

absl::Status NewFile::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(file_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return Failed("write");
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return absl::OkStatus();
}

absl::Status NewFile::Rename() const {
  if (!overwrite_) {
    const int code = renameat2(AT_FDCWD,
                               unfinished_.c_str(),
                               AT_FDCWD,
                               path_.c_str(),
                               RENAME_NOREPLACE);
    if (code == 0) return absl::OkStatus();
    if (errno == EEXIST) return Exists(path_);
    // EINVAL: the file system, e.g. NFS, does not support this rename.
    if (errno != EINVAL) return Failed("write");
    if (access(path_.c_str(), F_OK) == 0) return Exists(path_);
  }
  return rename(unfinished_.c_str(), path_.c_str()) == 0 ? absl::OkStatus()
                                                         : Failed("write");
}

absl::Status NewFile::Commit() {
  if (fsync(file_) != 0) return Failed("sync");
  const int closed = close(file_);
  file_ = -1;
  if (closed != 0) return Failed("write");
  const absl::Status renamed = Rename();
  if (!renamed.ok()) return renamed;
  unfinished_.clear();
  return SyncFolderOf(path_) ? absl::OkStatus() : Failed("sync the folder of");
}

}  // namespace selfcal::client
