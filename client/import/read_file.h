#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace selfcal::client {

// Returns the content of a file. INVALID_ARGUMENT for a folder, NOT_FOUND if it
// cannot be opened, UNKNOWN if it cannot be read to its end.
absl::StatusOr<std::string> ReadFile(const std::string& path);

}  // namespace selfcal::client
