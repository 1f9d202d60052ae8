// Where the daemon is, and how its connection is secured.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "client/selfcal/client.h"

namespace selfcal::client {

struct Target {
  // "unix:/path"; "host:port", with mutual TLS; "insecure:host:port", without.
  std::string address = "unix:/run/selfcal/selfcald.sock";
  // PEM files, for host:port alone.
  std::string ca_file = {};
  std::string certificate_file = {};
  std::string key_file = {};
};

// What the library connects with; it reads the files. INVALID_ARGUMENT for
// host:port without all three of them: nothing goes over a network in plain
// text unless it is asked for by name.
absl::StatusOr<ClientOptions> Resolve(const Target& target);

}  // namespace selfcal::client
