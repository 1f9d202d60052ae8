// The TLS files of a port that authenticates its callers by certificates.
#pragma once

#include <string>

namespace selfcal::server {

// PEM files for TCP addresses (tls_files.h). gRPC takes them up when they
// change (tls_reload.h); the console reads them at its start.
struct TlsOptions {
  std::string certificate;  // of the daemon, with intermediate certificates
  std::string key;          // of the certificate
  std::string client_ca;    // authority that signs the clients' certificates
  int refresh_s = 60;       // interval of checks for changed files

  friend bool operator==(const TlsOptions&, const TlsOptions&) = default;
};

}  // namespace selfcal::server
