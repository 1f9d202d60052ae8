#include "server/store/checksum.h"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/sha.h>

#include <new>

namespace selfcal::server {

std::string Sha256(std::string_view bytes) {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()),
         bytes.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return digest;
}

struct Sha256Stream::State {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context{
      EVP_MD_CTX_new(), EVP_MD_CTX_free};
};

Sha256Stream::Sha256Stream() : state_(std::make_unique<State>()) {
  if (state_->context == nullptr ||
      EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr) != 1) {
    throw std::bad_alloc();
  }
}

Sha256Stream::~Sha256Stream() = default;

void Sha256Stream::Add(std::string_view bytes) {
  EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size());
}

std::string Sha256Stream::Finish() {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  EVP_DigestFinal_ex(state_->context.get(),
                     reinterpret_cast<unsigned char*>(digest.data()),
                     nullptr);
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
