// An HTTP/1.1 server on one port, based on libmicrohttpd: a thread for each
// connection, with a limit on their number. Requests are limited in size and
// time; an invalid request ends at most its own connection. On interfaces other
// than the loopback, TLS is required, with certificates of the client
// authority, whose names state the rights of a caller, as over gRPC.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/access/tls_options.h"
#include "server/http/http.h"

namespace selfcal::server {

struct HttpOptions {
  std::string name;               // of the setting, in messages: "console"
  std::string address;            // host:port; port 0 selects a free one
  TlsOptions tls;                 // for interfaces other than the loopback
  Role local_role = Role::kRead;  // of callers on the loopback interface
};

class HttpServer {
 public:
  virtual ~HttpServer() = default;  // no handler runs after it

  // The URL, with the actual port and without a path.
  virtual const std::string& url() const = 0;
};

// Checks the options. INVALID_ARGUMENT for an invalid address, and for one that
// is not on the loopback interface if TLS is not set up; FAILED_PRECONDITION
// for TLS files that cannot be read.
absl::Status CheckHttpOptions(const HttpOptions& options);

// Starts a server; `handler` is called on many threads. Errors are those of
// CheckHttpOptions; UNAVAILABLE if the port cannot be opened.
absl::StatusOr<std::unique_ptr<HttpServer>> MakeHttpServer(
    const HttpOptions& options, HttpHandler handler);

}  // namespace selfcal::server
