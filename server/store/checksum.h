// SHA-256 of bytes: 32 bytes, as they lie in the sha256 columns.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>

namespace selfcal::server {

std::string Sha256(std::string_view bytes);

// DATA_LOSS, naming `what`, unless `sha256` is the checksum of `bytes`.
absl::Status VerifySha256(std::string_view bytes,
                          std::string_view sha256,
                          std::string_view what);

}  // namespace selfcal::server
