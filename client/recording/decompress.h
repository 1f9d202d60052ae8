// Decompression of the chunks of bags: lz4 frames, zstd, bzip2.
//
// Pure functions, callable from any thread.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::client {

// Largest chunk, and so the largest message, of any bag.
inline constexpr std::size_t kMaxChunkBytes = std::size_t{256} << 20;

enum class Compression { kNone, kLz4, kZstd, kBzip2 };

// Decompresses what becomes `size` bytes. DATA_LOSS if the bytes are damaged or
// become more or less, or if `size` exceeds kMaxChunkBytes. Memory is allocated
// as the content needs it, whatever `size` claims.
absl::StatusOr<std::string> Decompress(Compression compression,
                                       std::string_view bytes,
                                       std::size_t size);

}  // namespace selfcal::client
