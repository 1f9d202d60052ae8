// The web console: pages for a browser, and the contract over HTTP under
// /api/v1 (api.h). Off unless a port is given; a build may be without it
// (SELFCAL_CONSOLE).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/access/grants.h"
#include "server/access/tls_options.h"
#include "server/console/change_feed.h"
#include "server/pipeline/pipeline.h"
#include "server/store/store.h"

namespace selfcal::server {

struct ConsoleOptions {
  std::string address;  // host:port; port 0 takes a free one
  // Of whoever opens it on the loopback. Elsewhere certificates say.
  Role local_role = Role::kRead;
  TlsOptions tls;  // for an address off the loopback
  std::string program_version;
};

class Console {
 public:
  virtual ~Console() = default;  // nothing of it runs after that

  // With the port that was taken.
  virtual const std::string& url() const = 0;
};

// INVALID_ARGUMENT for what is no address, or off the loopback without TLS;
// FAILED_PRECONDITION for files of TLS that cannot be used, and in a build that
// has no console.
absl::Status CheckConsole(const ConsoleOptions& options);

// All three outlive it. Errors of CheckConsole; UNAVAILABLE if the port cannot
// be opened.
absl::StatusOr<std::unique_ptr<Console>> MakeConsole(
    Store* store,
    Pipeline* pipeline,
    ChangeFeed* feed,
    const ConsoleOptions& options);

}  // namespace selfcal::server
