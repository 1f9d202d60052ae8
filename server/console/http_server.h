// HTTP/1.1 on one port, by libmicrohttpd: a thread for each connection, of
// which there are so many at most. What comes from the network is bounded in
// size and time, and ends no more than its own connection. Off the loopback,
// TLS with certificates of the client authority, whose names say what a caller
// may do, as over gRPC.
//
// Not civetweb, which comes with prometheus-cpp: that of Debian 12 asks OpenSSL
// for a function that OpenSSL 3 does not have, and has no TLS therefore.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "server/access/tls_options.h"
#include "server/console/http.h"

namespace selfcal::server {

struct HttpOptions {
  std::string address;            // host:port; port 0 takes a free one
  TlsOptions tls;                 // for addresses off the loopback
  Role local_role = Role::kRead;  // of callers on the loopback
};

class HttpServer {
 public:
  virtual ~HttpServer() = default;  // no handler runs after it

  // With the port that was taken, without a path.
  virtual const std::string& url() const = 0;
};

// INVALID_ARGUMENT for what is no address, or without TLS off the loopback;
// FAILED_PRECONDITION for files of TLS that cannot be read.
absl::Status CheckHttpOptions(const HttpOptions& options);

// `handler` is called from many threads. Errors of CheckHttpOptions;
// UNAVAILABLE if the port cannot be opened.
absl::StatusOr<std::unique_ptr<HttpServer>> MakeHttpServer(
    const HttpOptions& options, HttpHandler handler);

}  // namespace selfcal::server
