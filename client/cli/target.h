// The address of the daemon, and how the connection is secured.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "client/selfcal/client.h"

namespace selfcal::client {

struct Target {
  // "unix:/path"; "host:port", with mutual TLS; "insecure:host:port", without.
  std::string address = "unix:/run/selfcal/selfcald.sock";
  // PEM files, for host:port only.
  std::string ca_file = {};
  std::string certificate_file = {};
  std::string key_file = {};
};

// Converts to the options of the client library, which reads the files.
// INVALID_ARGUMENT for host:port unless all three files are given: connections
// over a network are unencrypted only if the address says so explicitly.
absl::StatusOr<ClientOptions> Resolve(const Target& target);

}  // namespace selfcal::client
