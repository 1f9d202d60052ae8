// One file of the spool: a payload with its length and checksum. It is written
// atomically: after a crash or a power cut it is there as a whole or not at
// all.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace selfcal::client {

// Size of a file beyond its payload.
inline constexpr std::size_t kSpoolHeaderBytes = 20;

// Writes to `path`.tmp, syncs it, renames it to `path` and syncs the folder.
// RESOURCE_EXHAUSTED if the disk is full, UNAVAILABLE for other disk errors; no
// file is left after an error.
absl::Status WriteSpoolFile(const std::filesystem::path& path,
                            std::string_view payload);

// Returns the payload. DATA_LOSS if the file differs from what was written,
// UNAVAILABLE if it cannot be read.
absl::StatusOr<std::string> ReadSpoolFile(const std::filesystem::path& path);

}  // namespace selfcal::client
