// The TLS files for libmicrohttpd. They are read once, at the start.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/access/tls_options.h"

namespace selfcal::server {

struct TlsFiles {
  std::string certificate;
  std::string key;
  std::string client_ca;
};

// Reads the files. INVALID_ARGUMENT if one is not given, FAILED_PRECONDITION if
// one cannot be read or the key does not match the certificate.
absl::StatusOr<TlsFiles> ReadTlsFiles(const TlsOptions& options);

}  // namespace selfcal::server
