#include "server/daemon/state_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

namespace selfcal::server {
namespace {

absl::Status SystemError(const std::string& what, int error) {
  return absl::UnavailableError(what + ": " +
                                std::generic_category().message(error));
}

absl::Status CreateFolder(const std::filesystem::path& folder) {
  std::error_code error;
  const auto parent = std::filesystem::absolute(folder, error).parent_path();
  if (!error) std::filesystem::create_directories(parent, error);
  if (error) {
    return SystemError("cannot create " + parent.string(), error.value());
  }
  if (mkdir(folder.c_str(), S_IRWXU) == 0) return absl::OkStatus();
  if (errno == EEXIST && std::filesystem::is_directory(folder, error)) {
    return absl::OkStatus();
  }
  return SystemError("cannot create the folder " + folder.string(), errno);
}

// Returns the process id in the file, which the owner of the lock has written.
std::string ReadOwner(int file) {
  std::array<char, 32> text;
  const ssize_t size = pread(file, text.data(), text.size(), 0);
  std::string owner(text.data(), size > 0 ? size : 0);
  owner.erase(owner.find_last_not_of('\n') + 1);
  return owner.empty() ? "unknown" : owner;
}

bool WriteOwner(int file) {
  const std::string owner = std::to_string(getpid()) + "\n";
  return ftruncate(file, 0) == 0 &&
         pwrite(file, owner.data(), owner.size(), 0) ==
             static_cast<ssize_t>(owner.size());
}

}  // namespace

absl::StatusOr<StateLock> StateLock::Take(const std::filesystem::path& folder) {
  if (absl::Status made = CreateFolder(folder); !made.ok()) return made;
  const std::string path = (folder / "lock").string();
  const int file =
      open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (file < 0) return SystemError("cannot open " + path, errno);
  StateLock lock(path, file);
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return SystemError("cannot lock " + path, errno);
    return absl::FailedPreconditionError(
        "the state folder " + folder.string() +
        " is in use by another selfcald (process " + ReadOwner(file) +
        "); stop it, or name another folder with --state-dir");
  }
  if (!WriteOwner(file)) return SystemError("cannot write " + path, errno);
  return lock;
}

StateLock::StateLock(StateLock&& other) noexcept
    : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)) {}

bool StateLock::IsInPlace() const {
  struct stat locked {};
  struct stat named {};
  return fstat(file_, &locked) == 0 && stat(path_.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

StateLock::~StateLock() {
  if (file_ >= 0) close(file_);
}

}  // namespace selfcal::server
