// Files that are read at any place.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace selfcal::client {

// An open file. Not thread-safe.
class InputFile {
 public:
  // NOT_FOUND with the path for a file that cannot be opened.
  static absl::StatusOr<std::unique_ptr<InputFile>> Open(
      const std::string& path);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }

  // Reads `size` bytes at `offset` into *bytes. DATA_LOSS with the path if the
  // file ends before or cannot be read.
  absl::Status ReadAt(std::uint64_t offset,
                      std::size_t size,
                      std::string* bytes) const;

 private:
  InputFile(std::string path, int descriptor, std::uint64_t size);

  const std::string path_;
  const int descriptor_;
  const std::uint64_t size_;
};

// Largest file of an image.
inline constexpr std::size_t kMaxImageFileBytes = std::size_t{256} << 20;

// Reads a file. NOT_FOUND if it cannot be opened, DATA_LOSS if it cannot be
// read or is larger than `max_size`.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          std::size_t max_size);

}  // namespace selfcal::client
