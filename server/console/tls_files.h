// The files of TLS, as libmicrohttpd takes them. They are read at the start.
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

// INVALID_ARGUMENT where one is not given, FAILED_PRECONDITION where it cannot
// be read or the key is not that of the certificate.
absl::StatusOr<TlsFiles> ReadTlsFiles(const TlsOptions& options);

}  // namespace selfcal::server
