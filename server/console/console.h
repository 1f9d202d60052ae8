// The web console: pages for a browser, and the contract over HTTP under
// /api/v1 (api.h). It is off unless a port is given, and can be excluded from
// the build (SELFCAL_CONSOLE).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/access/grants.h"
#include "server/access/tls_options.h"
#include "server/api/api.h"

namespace selfcal::server {

struct ConsoleOptions {
  std::string address;  // host:port; port 0 selects a free one
  // Role of callers on the loopback interface. On other interfaces,
  // certificates state the rights.
  Role local_role = Role::kRead;
  TlsOptions tls;  // for an address that is not on the loopback interface
};

class Console {
 public:
  virtual ~Console() = default;  // no thread of it runs after that

  // The URL, with the actual port.
  virtual const std::string& url() const = 0;
};

// Checks the options. INVALID_ARGUMENT for an invalid address, and for one that
// is not on the loopback interface if TLS is not set up; FAILED_PRECONDITION
// for unusable TLS files, and in a build without the console.
absl::Status CheckConsole(const ConsoleOptions& options);

// Starts the console; `api` must outlive it. Errors are those of CheckConsole;
// UNAVAILABLE if it cannot open the port.
absl::StatusOr<std::unique_ptr<Console>> MakeConsole(
    const Api* api, const ConsoleOptions& options);

}  // namespace selfcal::server
