#include "client/recording/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace selfcal::client {

InputFile::InputFile(std::string path, int descriptor, std::uint64_t size)
    : path_(std::move(path)), descriptor_(descriptor), size_(size) {}

InputFile::~InputFile() { ::close(descriptor_); }

absl::StatusOr<std::unique_ptr<InputFile>> InputFile::Open(
    const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status = {};
  if (descriptor < 0 || ::fstat(descriptor, &status) != 0 ||
      !S_ISREG(status.st_mode)) {
    if (descriptor >= 0) ::close(descriptor);
    return absl::NotFoundError(fmt::format("{}: cannot be opened", path));
  }
  return std::unique_ptr<InputFile>(new InputFile(
      path, descriptor, static_cast<std::uint64_t>(status.st_size)));
}

absl::Status InputFile::ReadAt(std::uint64_t offset,
                               std::size_t size,
                               std::string* bytes) const {
  if (offset > size_ || size > size_ - offset) {
    return absl::DataLossError(fmt::format("{}: ends too early", path_));
  }
  bytes->resize(size);
  for (std::size_t done = 0; done < size;) {
    const ssize_t got = ::pread(descriptor_,
                                bytes->data() + done,
                                size - done,
                                static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      return absl::DataLossError(fmt::format(
          "{}: cannot be read: {}",
          path_,
          got < 0 ? std::strerror(errno) : "it has become shorter"));
    }
    done += static_cast<std::size_t>(got);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          std::size_t max_size) {
  const auto file = InputFile::Open(path);
  if (!file.ok()) return file.status();
  const std::uint64_t size = (*file)->size();
  if (size > max_size) {
    return absl::DataLossError(fmt::format(
        "{}: {} bytes are more than the {} allowed", path, size, max_size));
  }
  std::string bytes;
  const absl::Status read = (*file)->ReadAt(0, size, &bytes);
  if (!read.ok()) return read;
  return bytes;
}

}  // namespace selfcal::client
