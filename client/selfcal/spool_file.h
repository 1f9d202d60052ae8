// One file of the spool: a payload with its length and checksum, written so
// that after a crash or a power cut it is there as a whole or not at all.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace selfcal::client {

// What a file takes beyond its payload.
inline constexpr std::size_t kSpoolHeaderBytes = 20;

// Writes to `path`.tmp, syncs it, renames it to `path` and syncs the folder.
// RESOURCE_EXHAUSTED when the disk is full, UNAVAILABLE for other errors of it;
// nothing is left then.
absl::Status WriteSpoolFile(const std::filesystem::path& path,
                            std::string_view payload);

// The payload. DATA_LOSS if it is not what was written, UNAVAILABLE if the file
// cannot be read.
absl::StatusOr<std::string> ReadSpoolFile(const std::filesystem::path& path);

}  // namespace selfcal::client
