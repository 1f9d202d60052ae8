// SHA-256 checksums: 32 bytes, as stored in the sha256 columns.
#pragma once

#include <absl/status/status.h>

#include <memory>
#include <string>
#include <string_view>

namespace selfcal::server {

std::string Sha256(std::string_view bytes);

// Checksum of bytes that arrive in pieces.
class Sha256Stream {
 public:
  Sha256Stream();
  ~Sha256Stream();
  void Add(std::string_view bytes);
  std::string Finish();  // call once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// DATA_LOSS, naming `what`, unless `sha256` is the checksum of `bytes`.
absl::Status VerifySha256(std::string_view bytes,
                          std::string_view sha256,
                          std::string_view what);

}  // namespace selfcal::server
