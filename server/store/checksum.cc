#include "server/store/checksum.h"

#include <fmt/format.h>
#include <openssl/sha.h>

namespace selfcal::server {

std::string Sha256(std::string_view bytes) {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()),
         bytes.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return digest;
}

absl::Status VerifySha256(std::string_view bytes,
                          std::string_view sha256,
                          std::string_view what) {
  if (Sha256(bytes) == sha256) {
    return absl::OkStatus();
  }
  return absl::DataLossError(
      fmt::format("{} is damaged: its checksum does not match; check the disk, "
                  "and restore the database from a backup if it is needed",
                  what));
}

}  // namespace selfcal::server
