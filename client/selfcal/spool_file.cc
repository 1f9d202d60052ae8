#include "client/selfcal/spool_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <system_error>

namespace selfcal::client {
namespace {

constexpr std::string_view kMagic = "selfspl1";

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }

 private:
  const int fd_;
};

absl::Status DiskError(const char* what, const std::filesystem::path& path) {
  const int error = errno;
  const std::string message =
      fmt::format("cannot {} {}: {}", what, path.string(), strerror(error));
  if (error == ENOSPC || error == EDQUOT) {
    return absl::ResourceExhaustedError(message);
  }
  return absl::UnavailableError(message);
}

// Writes a number little-endian, as all numbers of the header are.
template <typename T>
void Put(T value, char* bytes) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bytes[i] = static_cast<char>(value >> (8 * i));
  }
}

std::array<char, kSpoolHeaderBytes> Header(std::string_view payload) {
  std::array<char, kSpoolHeaderBytes> header;
  std::memcpy(header.data(), kMagic.data(), kMagic.size());
  Put(static_cast<std::uint64_t>(payload.size()), header.data() + 8);
  uLong crc = crc32_z(0, nullptr, 0);
  crc = crc32_z(crc, reinterpret_cast<const Bytef*>(header.data()), 16);
  crc = crc32_z(
      crc, reinterpret_cast<const Bytef*>(payload.data()), payload.size());
  Put(static_cast<std::uint32_t>(crc), header.data() + 16);
  return header;
}

bool WriteAll(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

absl::Status WriteAndSync(const std::filesystem::path& path,
                          std::string_view payload) {
  const FileDescriptor file(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (file.get() < 0) return DiskError("create", path);
  const auto header = Header(payload);
  if (!WriteAll(file.get(), {header.data(), header.size()}) ||
      !WriteAll(file.get(), payload)) {
    return DiskError("write", path);
  }
  if (::fdatasync(file.get()) != 0) return DiskError("sync", path);
  return absl::OkStatus();
}

absl::Status SyncFolder(const std::filesystem::path& folder) {
  const FileDescriptor file(
      ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.get() < 0 || ::fsync(file.get()) != 0) {
    return DiskError("sync", folder);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteSpoolFile(const std::filesystem::path& path,
                            std::string_view payload) {
  const std::filesystem::path unfinished = path.string() + ".tmp";
  absl::Status status = WriteAndSync(unfinished, payload);
  if (status.ok() && ::rename(unfinished.c_str(), path.c_str()) != 0) {
    status = DiskError("rename", unfinished);
  }
  if (!status.ok()) {
    ::unlink(unfinished.c_str());
    return status;
  }
  status = SyncFolder(path.parent_path());
  if (!status.ok()) ::unlink(path.c_str());
  return status;
}

absl::StatusOr<std::string> ReadSpoolFile(const std::filesystem::path& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat about;
  if (file.get() < 0 || ::fstat(file.get(), &about) != 0) {
    return DiskError("open", path);
  }
  std::string bytes(static_cast<std::size_t>(about.st_size), '\0');
  std::size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t got =
        ::read(file.get(), bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return DiskError("read", path);
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  bytes.resize(size);
  if (size >= kSpoolHeaderBytes) {
    std::string payload = bytes.substr(kSpoolHeaderBytes);
    const auto header = Header(payload);
    if (std::memcmp(header.data(), bytes.data(), header.size()) == 0) {
      return payload;
    }
  }
  return absl::DataLossError(
      fmt::format("{} is damaged: its checksum does not match", path.string()));
}

}  // namespace selfcal::client
