#include "client/recording/chunked_file.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

namespace selfcal::client {
namespace {

constexpr std::uint64_t kWindowBytes = 16 << 10;

absl::Status EndsEarly() {
  return absl::DataLossError("it ends within a record");
}

}  // namespace

ChunkedFile::ChunkedFile(std::unique_ptr<InputFile> file,
                         std::size_t kept_bytes)
    : file_(std::move(file)), kept_bytes_(kept_bytes) {}

absl::StatusOr<std::shared_ptr<const std::string>> ChunkedFile::AddChunk(
    const FileChunk& chunk, std::int32_t* number) {
  auto content = Load(chunk);
  if (!content.ok()) return content;
  *number = static_cast<std::int32_t>(chunks_.size());
  chunks_.push_back(chunk);
  Keep(*number, *content);
  return content;
}

absl::StatusOr<std::string_view> ChunkedFile::Read(const MessagePlace& place,
                                                   std::size_t max_size) {
  const std::size_t size = std::min<std::size_t>(place.size, max_size);
  if (place.chunk < 0) {
    const absl::Status read = file_->ReadAt(place.offset, size, &buffer_);
    if (!read.ok()) return read;
    return buffer_;
  }
  const auto content = Content(place.chunk);
  if (!content.ok()) return content.status();
  // The place was found in this very content, which the cache keeps.
  if (place.offset > (*content)->size() ||
      size > (*content)->size() - place.offset) {
    return absl::DataLossError("the file has changed");
  }
  return std::string_view(**content).substr(place.offset, size);
}

absl::StatusOr<std::shared_ptr<const std::string>> ChunkedFile::Load(
    const FileChunk& chunk) {
  if (chunk.compressed_size > kMaxChunkBytes) {
    return absl::DataLossError("a chunk is larger than allowed");
  }
  const absl::Status read =
      file_->ReadAt(chunk.offset, chunk.compressed_size, &compressed_);
  if (!read.ok()) return read;
  auto content = Decompress(chunk.compression, compressed_, chunk.size);
  if (!content.ok()) return content.status();
  if (chunk.crc32 &&
      *chunk.crc32 != crc32_z(0,
                              reinterpret_cast<const Bytef*>(content->data()),
                              content->size())) {
    return absl::DataLossError("its checksum is another one");
  }
  return std::make_shared<const std::string>(*std::move(content));
}

absl::StatusOr<std::shared_ptr<const std::string>> ChunkedFile::Content(
    std::int32_t number) {
  const auto kept =
      std::find_if(kept_.begin(), kept_.end(), [&](const Kept& each) {
        return each.number == number;
      });
  if (kept != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, kept);
    return kept_.front().content;
  }
  auto content = Load(chunks_[static_cast<std::size_t>(number)]);
  if (content.ok()) Keep(number, *content);
  return content;
}

void ChunkedFile::Keep(std::int32_t number,
                       std::shared_ptr<const std::string> content) {
  std::size_t bytes = content->size();
  kept_.push_front({number, std::move(content)});
  for (auto it = std::next(kept_.begin()); it != kept_.end();) {
    bytes += it->content->size();
    it = bytes > kept_bytes_ ? kept_.erase(it) : std::next(it);
  }
}

RecordCursor::RecordCursor(const InputFile* file,
                           std::uint64_t begin,
                           std::uint64_t end)
    : file_(file), window_at_(begin), at_(begin), end_(end) {}

RecordCursor::RecordCursor(std::string_view memory)
    : memory_(memory), end_(memory.size()) {}

absl::StatusOr<std::string_view> RecordCursor::Take(std::uint64_t size) {
  if (size > left()) return EndsEarly();
  const std::uint64_t begin = at_;
  at_ += size;
  if (file_ == nullptr) return memory_.substr(begin, size);
  if (begin < window_at_ || begin + size > window_at_ + window_.size()) {
    const std::uint64_t window =
        std::min(std::max(size, kWindowBytes), end_ - begin);
    const absl::Status read = file_->ReadAt(begin, window, &window_);
    if (!read.ok()) return read;
    window_at_ = begin;
  }
  return std::string_view(window_).substr(begin - window_at_, size);
}

absl::Status RecordCursor::Skip(std::uint64_t size) {
  if (size > left()) return EndsEarly();
  at_ += size;
  return absl::OkStatus();
}

}  // namespace selfcal::client
