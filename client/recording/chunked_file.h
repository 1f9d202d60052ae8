// Records in a file and in its compressed chunks, as the bags of ROS 1 and MCAP
// have them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/recording/decompress.h"
#include "client/recording/input_file.h"
#include "client/recording/message_file.h"

namespace selfcal::client {

// A compressed chunk in a file.
struct FileChunk {
  std::uint64_t offset = 0;  // of the compressed bytes
  std::size_t compressed_size = 0;
  std::size_t size = 0;
  Compression compression = Compression::kNone;
  std::optional<std::uint32_t> crc32;  // of the content
};

// Reads bytes of a file and of its chunks, a few of which are kept
// decompressed. Not thread-safe.
class ChunkedFile {
 public:
  // Chunks that are kept: the last one, and others up to `kept_bytes` with it.
  explicit ChunkedFile(std::unique_ptr<InputFile> file,
                       std::size_t kept_bytes = std::size_t{16} << 20);

  const InputFile& file() const { return *file_; }

  // Decompresses a chunk and remembers it under the number *chunk. DATA_LOSS if
  // it is damaged; then it has no number.
  absl::StatusOr<std::shared_ptr<const std::string>> AddChunk(
      const FileChunk& chunk, std::int32_t* number);

  // The same as MessageFile::Read.
  absl::StatusOr<std::string_view> Read(const MessagePlace& place,
                                        std::size_t max_size);

 private:
  struct Kept {
    std::int32_t number;
    std::shared_ptr<const std::string> content;
  };

  absl::StatusOr<std::shared_ptr<const std::string>> Load(
      const FileChunk& chunk);
  absl::StatusOr<std::shared_ptr<const std::string>> Content(
      std::int32_t number);
  void Keep(std::int32_t number, std::shared_ptr<const std::string> content);

  const std::unique_ptr<InputFile> file_;
  const std::size_t kept_bytes_;
  std::vector<FileChunk> chunks_;
  std::list<Kept> kept_;  // the one that was used last comes first
  std::string buffer_;    // what Read returned from the file
  std::string compressed_;
};

// Bytes at one place after another, of a range of a file or of memory.
class RecordCursor {
 public:
  // A range of a file.
  RecordCursor(const InputFile* file, std::uint64_t begin, std::uint64_t end);
  // A decompressed chunk, which must outlive it.
  explicit RecordCursor(std::string_view memory);

  std::uint64_t at() const { return at_; }
  std::uint64_t left() const { return end_ - at_; }

  // Returns the next bytes and moves behind them; they are valid until the next
  // call. DATA_LOSS if fewer are left, or if they cannot be read.
  absl::StatusOr<std::string_view> Take(std::uint64_t size);
  absl::Status Skip(std::uint64_t size);

 private:
  const InputFile* const file_ = nullptr;
  const std::string_view memory_;
  std::string window_;
  std::uint64_t window_at_ = 0;
  std::uint64_t at_ = 0;
  const std::uint64_t end_;
};

// Number, little-endian, at the start of some bytes, which must have it.
template <typename T>
T LittleEndian(std::string_view bytes) {
  T value = 0;
  for (std::size_t i = sizeof(T); i-- > 0;) {
    value = static_cast<T>(value << 8 | static_cast<unsigned char>(bytes[i]));
  }
  return value;
}

}  // namespace selfcal::client
