#include "server/daemon/startable.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <set>
#include <string_view>
#include <utility>

#include "migrations/migrations.h"
#include "server/status/status_macros.h"
#include "server/store/sqlite/database_file.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

class FileDescriptor {
 public:
  explicit FileDescriptor(int number) : number_(number) {}
  ~FileDescriptor() {
    if (number_ >= 0) close(number_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int operator*() const { return number_; }

 private:
  int number_;
};

std::string Reason(int error) { return std::strerror(error); }

// The folder itself or, if it does not exist, the nearest above that does.
fs::path NearestThatExists(fs::path folder) {
  std::error_code error;
  folder = fs::absolute(folder, error);
  while (!fs::exists(folder, error) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  return folder;
}

absl::Status CheckWritable(const std::string& what, const fs::path& folder) {
  const fs::path nearest = NearestThatExists(folder);
  std::error_code error;
  if (!fs::is_directory(nearest, error)) {
    return absl::FailedPreconditionError(fmt::format(
        "{} {}: {} is not a folder", what, folder.string(), nearest.string()));
  }
  if (access(nearest.c_str(), R_OK | W_OK | X_OK) == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("{} {}: the daemon cannot write to {}: {}; start it as its "
                  "owner, or change the folder's owner",
                  what,
                  folder.string(),
                  nearest.string(),
                  Reason(errno)));
}

// A lock that is shared meets one that a daemon holds, and no other.
absl::Status CheckLock(const fs::path& folder) {
  const std::string path = (folder / "lock").string();
  const FileDescriptor file(open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (*file < 0) {
    if (errno == ENOENT) return absl::OkStatus();
    return absl::FailedPreconditionError(
        fmt::format("cannot open {}: {}", path, Reason(errno)));
  }
  if (flock(*file, LOCK_SH | LOCK_NB) == 0) return absl::OkStatus();
  if (errno != EWOULDBLOCK) {
    return absl::FailedPreconditionError(
        fmt::format("cannot lock {}: {}", path, Reason(errno)));
  }
  std::array<char, 32> text{};
  const ssize_t size = pread(*file, text.data(), text.size(), 0);
  std::string owner(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  owner.erase(owner.find_last_not_of('\n') + 1);
  return absl::FailedPreconditionError(
      fmt::format("the state folder {} is in use by another selfcald (process "
                  "{}); stop it, or name another folder with --state-dir",
                  folder.string(),
                  owner.empty() ? "unknown" : owner));
}

// The schema version in the header of the file; opening the database would
// change files.
std::int64_t SchemaVersion(int file) {
  constexpr off_t kOffset = 60;  // of the user version, in network byte order
  std::array<unsigned char, 4> bytes{};
  if (pread(file, bytes.data(), bytes.size(), kOffset) !=
      static_cast<ssize_t>(bytes.size())) {
    return 0;
  }
  std::int64_t version = 0;
  for (const unsigned char byte : bytes) version = version * 256 + byte;
  return version;
}

absl::Status CheckDatabase(const std::string& path) {
  SELFCAL_ASSIGN_OR_RETURN(const DatabaseFile found, InspectDatabaseFile(path));
  if (found == DatabaseFile::kAbsent) return absl::OkStatus();
  const FileDescriptor file(open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (*file < 0) {
    return absl::FailedPreconditionError(
        fmt::format("cannot open {}: {}", path, Reason(errno)));
  }
  const std::int64_t version = SchemaVersion(*file);
  const std::size_t newest = SqliteMigrations().size();
  if (version <= static_cast<std::int64_t>(newest)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "{} has schema version {}, this program knows up to {}: use the program "
      "that wrote it, or its backup of version {}",
      path,
      version,
      newest,
      newest));
}

absl::Status CheckSocketFolder(const fs::path& state_folder,
                               const std::string& path) {
  std::error_code error;
  const fs::path folder = fs::absolute(path, error).parent_path();
  const bool made = folder == fs::absolute(state_folder, error);
  if (!made && !fs::exists(folder, error)) {
    return absl::FailedPreconditionError(fmt::format(
        "unix:{}: there is no folder {}; create it", path, folder.string()));
  }
  return CheckWritable("unix socket in", folder);
}

absl::Status CheckSocket(const fs::path& state_folder,
                         const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(
        fmt::format("unix:{}: a path must have 1 to {} characters",
                    path,
                    sizeof(address.sun_path) - 1));
  }
  SELFCAL_RETURN_IF_ERROR(CheckSocketFolder(state_folder, path));
  std::error_code error;
  if (!fs::exists(path, error)) return absl::OkStatus();
  if (!fs::is_socket(path, error)) {
    return absl::FailedPreconditionError(
        fmt::format("unix:{}: there is a file that is not a socket", path));
  }
  path.copy(address.sun_path, path.size());
  const FileDescriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (connect(*probe,
              reinterpret_cast<const sockaddr*>(&address),
              sizeof(address)) != 0) {
    return absl::OkStatus();  // left by a crash; a start replaces it
  }
  return absl::FailedPreconditionError(
      fmt::format("unix:{}: another program listens on it", path));
}

absl::Status BadAddress(const std::string& address, const std::string& why) {
  return absl::InvalidArgumentError(fmt::format("{}: {}", address, why));
}

// Binds the port, and frees it again.
absl::Status CheckPort(const std::string& address) {
  const auto colon = address.rfind(':');
  if (colon == address.npos || colon == 0) {
    return BadAddress(address, "is not of the form host:port or unix:/path");
  }
  std::string host = address.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  }
  const std::string port = address.substr(colon + 1);
  int number = -1;
  const auto [end, bad] =
      std::from_chars(port.data(), port.data() + port.size(), number);
  if (bad != std::errc() || end != port.data() + port.size() || number < 0 ||
      number > 65535) {
    return BadAddress(address, "the port must be a number from 0 to 65535");
  }
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* list = nullptr;
  if (const int failed =
          getaddrinfo(host.c_str(), port.c_str(), &hints, &list)) {
    return BadAddress(
        address, "the host is unknown: " + std::string(gai_strerror(failed)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> found(list,
                                                             freeaddrinfo);
  // As for the daemon, one address of a name is enough.
  int error = EADDRNOTAVAIL;
  for (const addrinfo* one = found.get(); one != nullptr; one = one->ai_next) {
    const FileDescriptor probe(
        socket(one->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const int on = 1;
    setsockopt(*probe, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    if (*probe >= 0 && bind(*probe, one->ai_addr, one->ai_addrlen) == 0) {
      return absl::OkStatus();
    }
    error = errno;
  }
  return absl::FailedPreconditionError(
      fmt::format("cannot listen on {}: {}", address, Reason(error)));
}

}  // namespace

absl::Status CheckStateFolder(const std::filesystem::path& folder) {
  SELFCAL_RETURN_IF_ERROR(CheckWritable("state-dir", folder));
  SELFCAL_RETURN_IF_ERROR(CheckLock(folder));
  return CheckDatabase((folder / "selfcal.db").string());
}

absl::Status CheckAddresses(const std::filesystem::path& state_folder,
                            const std::vector<std::string>& listen,
                            const std::vector<std::string>& ports) {
  constexpr std::string_view kInsecure = "insecure:";
  constexpr std::string_view kUnix = "unix:";
  std::vector<std::string> all = ports;
  std::set<std::string> seen;
  for (const std::string& address : listen) {
    if (address.starts_with(kUnix)) {
      std::string path = address.substr(kUnix.size());
      if (path.starts_with("//")) path = path.substr(2);
      SELFCAL_RETURN_IF_ERROR(CheckSocket(state_folder, path));
      if (!seen.insert(path).second) {
        return BadAddress(address, "is given twice");
      }
    } else {
      all.push_back(address.starts_with(kInsecure)
                        ? address.substr(kInsecure.size())
                        : address);
    }
  }
  for (const std::string& address : all) {
    SELFCAL_RETURN_IF_ERROR(CheckPort(address));
    const bool chosen = address.ends_with(":0");  // by the system
    if (!chosen && !seen.insert(address).second) {
      return BadAddress(address, "is given twice");
    }
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
