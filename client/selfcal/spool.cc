#include "client/selfcal/spool.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "client/selfcal/spool_file.h"

namespace selfcal::client {
namespace {

constexpr const char* kSegment = ".segment";
constexpr const char* kDamaged = ".damaged";
constexpr std::size_t kDigits = 20;

std::optional<std::uint64_t> ParseNumber(const std::string& stem) {
  std::uint64_t number = 0;
  const char* end = stem.data() + stem.size();
  const auto parsed = std::from_chars(stem.data(), end, number);
  const bool whole = parsed.ec == std::errc() && parsed.ptr == end;
  if (!whole || stem.size() != kDigits) return std::nullopt;
  return number;
}

absl::Status Unavailable(const std::filesystem::path& folder,
                         const std::string& why) {
  return absl::UnavailableError(
      fmt::format("cannot use the spool {}: {}", folder.string(), why));
}

absl::StatusOr<int> Lock(const std::filesystem::path& folder) {
  const std::string path = folder / "lock";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return Unavailable(folder, strerror(errno));
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  const int error = errno;
  ::close(fd);
  if (error != EWOULDBLOCK) return Unavailable(folder, strerror(error));
  return absl::AlreadyExistsError(fmt::format(
      "the spool {} is in use; give each process, and each stream of it, a "
      "folder of its own",
      folder.string()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Spool>> Spool::Open(
    const std::filesystem::path& folder, std::uint64_t max_bytes) {
  std::error_code error;
  const bool made = std::filesystem::create_directories(folder, error);
  if (made && !error) {
    std::filesystem::permissions(
        folder, std::filesystem::perms::owner_all, error);
  }
  if (error) return Unavailable(folder, error.message());
  const auto lock = Lock(folder);
  if (!lock.ok()) return lock.status();
  std::unique_ptr<Spool> spool(new Spool(folder, max_bytes, *lock));
  const absl::Status status = spool->Recover();
  if (!status.ok()) return status;
  return spool;
}

Spool::Spool(std::filesystem::path folder, std::uint64_t max_bytes, int lock)
    : folder_(std::move(folder)), max_bytes_(max_bytes), lock_(lock) {}

Spool::~Spool() { ::close(lock_); }

absl::Status Spool::Recover() {
  std::vector<std::filesystem::path> unfinished;
  std::error_code error;
  for (std::filesystem::directory_iterator file(folder_, error), end;
       !error && file != end;
       file.increment(error)) {
    const std::filesystem::path& path = file->path();
    if (path.extension() == ".tmp") unfinished.push_back(path);
    const auto number = ParseNumber(path.stem().string());
    if (!number.has_value()) continue;
    std::error_code gone;
    const std::uint64_t bytes = file->file_size(gone);
    if (gone) continue;
    if (path.extension() == kSegment) {
      files_[*number] = bytes;
    } else if (path.extension() == kDamaged) {
      damaged_[*number] = bytes;
    } else {
      continue;
    }
    bytes_ += bytes;
    next_number_ = std::max(next_number_, *number + 1);
  }
  if (error) return Unavailable(folder_, error.message());
  for (const auto& path : unfinished) std::filesystem::remove(path, error);
  return absl::OkStatus();
}

std::uint64_t Spool::next_number() const { return next_number_; }

absl::Status Spool::Write(std::uint64_t number, std::string_view payload) {
  const std::uint64_t bytes = payload.size() + kSpoolHeaderBytes;
  MakeRoom(bytes);
  if (bytes_ + bytes > max_bytes_) {
    return absl::ResourceExhaustedError(
        fmt::format("the spool {} is full: {} of {} bytes",
                    folder_.string(),
                    bytes_,
                    max_bytes_));
  }
  const absl::Status status = WriteSpoolFile(Path(number, kSegment), payload);
  if (!status.ok()) return status;
  files_[number] = bytes;
  bytes_ += bytes;
  next_number_ = std::max(next_number_, number + 1);
  return absl::OkStatus();
}

void Spool::MakeRoom(std::uint64_t bytes) {
  while (bytes_ + bytes > max_bytes_ && !damaged_.empty()) {
    const auto oldest = damaged_.begin();
    ::unlink(Path(oldest->first, kDamaged).c_str());
    bytes_ -= oldest->second;
    damaged_.erase(oldest);
  }
}

std::optional<std::uint64_t> Spool::FirstFrom(std::uint64_t number) const {
  const auto file = files_.lower_bound(number);
  if (file == files_.end()) return std::nullopt;
  return file->first;
}

absl::StatusOr<std::string> Spool::Read(std::uint64_t number) const {
  return ReadSpoolFile(Path(number, kSegment));
}

void Spool::Remove(std::uint64_t number) {
  const auto file = files_.find(number);
  if (file == files_.end()) return;
  ::unlink(Path(number, kSegment).c_str());
  bytes_ -= file->second;
  files_.erase(file);
}

void Spool::Quarantine(std::uint64_t number) {
  const auto file = files_.find(number);
  if (file == files_.end()) return;
  if (::rename(Path(number, kSegment).c_str(),
               Path(number, kDamaged).c_str()) == 0) {
    damaged_[number] = file->second;
  } else {
    bytes_ -= file->second;
  }
  files_.erase(file);
}

std::filesystem::path Spool::Path(std::uint64_t number,
                                  const char* suffix) const {
  return folder_ / fmt::format("{:020}{}", number, suffix);
}

}  // namespace selfcal::client
