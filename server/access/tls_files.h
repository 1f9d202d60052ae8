// The content of the TLS files, checked as a whole: a certificate, its key and
// the authority of the clients are used together or not at all.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/access/tls_options.h"

namespace selfcal::server {

// PEM.
struct TlsFiles {
  std::string certificate;  // with intermediate certificates
  std::string key;
  std::string client_ca;
  std::int64_t expiry_s = 0;  // of the certificate, since the Unix epoch

  friend bool operator==(const TlsFiles&, const TlsFiles&) = default;
};

// Reads the files and checks that they can be used at this time (since the Unix
// epoch): each is PEM, the key is that of the certificate and not encrypted,
// and the certificate is valid. INVALID_ARGUMENT if a file is not named,
// FAILED_PRECONDITION otherwise; the message names the file and never quotes
// its content.
absl::StatusOr<TlsFiles> ReadTlsFiles(const TlsOptions& options,
                                      std::int64_t now_s);

}  // namespace selfcal::server
