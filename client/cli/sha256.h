// SHA-256 of data that arrives in pieces.
#pragma once

#include <openssl/evp.h>

#include <memory>
#include <string>
#include <string_view>

namespace selfcal::client {

class Sha256 {
 public:
  Sha256();
  void Add(std::string_view bytes);
  std::string Finish();  // returns 32 bytes; may be called once

 private:
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

// Hexadecimal digits, as sha256sum prints them.
std::string HexText(std::string_view bytes);

}  // namespace selfcal::client
