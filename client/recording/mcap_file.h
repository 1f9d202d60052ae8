// MCAP files (mcap.dev/spec) with messages of ROS 2 (encoding cdr) and ROS 1
// (encoding ros1), in chunks that are uncompressed, lz4 or zstd, or in none. Of
// the summary only the definitions of channels are used, and no index: files
// without them, or that are cut off, are read as well. The checksum of a chunk
// is checked if it is compressed.
#pragma once

#include <cstdint>
#include <memory>

#include "client/recording/input_file.h"
#include "client/recording/message_file.h"

namespace selfcal::client {

// A file whose records begin at `begin`, behind the magic bytes.
std::unique_ptr<MessageFile> MakeMcapFile(std::unique_ptr<InputFile> file,
                                          std::uint64_t begin);

}  // namespace selfcal::client
