// What a port needs to know its callers by their certificates.
#pragma once

#include <string>

namespace selfcal::server {

// PEM files, for addresses of TCP. They are read anew when they change; a
// change that cannot be used leaves the ones before in place.
struct TlsOptions {
  std::string certificate;  // of the daemon, with those between it and its root
  std::string key;          // of the certificate
  std::string client_ca;    // whose certificates clients must have
  int refresh_s = 60;       // how often the files are looked at

  friend bool operator==(const TlsOptions&, const TlsOptions&) = default;
};

}  // namespace selfcal::server
