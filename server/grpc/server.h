// The gRPC server: the services of the API, grpc.health.v1 and reflection, on
// unix sockets or TCP ports (credentials.h describes their security).
// server/access defines what a caller may do; health and reflection are open to
// all connections. Any thread may call.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/access/grants.h"
#include "server/access/tls_options.h"
#include "server/access/tls_reload.h"
#include "server/api/api.h"

namespace selfcal::server {

// Permissions of unix sockets. Those of their folder apply in addition.
struct SocketOptions {
  std::string group;     // empty: the group of the process
  unsigned mode = 0660;  // users with write permission may connect

  friend bool operator==(const SocketOptions&, const SocketOptions&) = default;
};

struct ServerOptions {
  // "unix:/path", "host:port" or "insecure:host:port"; port 0 selects a free
  // one.
  std::vector<std::string> listen;
  TlsOptions tls;
  SocketOptions socket;
  // Role of callers without a certificate, over unix sockets and insecure
  // ports.
  Role local_role = Role::kAdminister;
  int max_receive_bytes = 64 << 20;  // for one message; compressed: none
  // Calls that are being answered; each occupies a thread, but watches do not.
  // Calls, watches and streams of segments beyond their limits are refused with
  // RESOURCE_EXHAUSTED.
  int max_threads = 128;
  int max_watches = 10'000;
  int max_segment_streams = 256;
  // For messages in flight and for their parsed form.
  std::int64_t max_memory_bytes = 512 << 20;
  // A caller that does not read a response of a stream for so long is cut off.
  std::chrono::milliseconds max_write_time{60'000};
  int max_streams = 100;  // concurrent calls on one connection; others wait

  friend bool operator==(const ServerOptions&, const ServerOptions&) = default;
};

// Checks the options without opening anything. INVALID_ARGUMENT without an
// address, for a TCP address without TLS, or for an unknown group;
// FAILED_PRECONDITION for unusable TLS files.
absl::Status CheckServerOptions(const ServerOptions& options);

class Server {
 public:
  virtual ~Server() = default;  // like Shutdown with a deadline of 0

  // The addresses with the actual ports, in the form for a client.
  virtual const std::vector<std::string>& addresses() const = 0;

  // The TLS files in force; null without a TCP address with TLS.
  virtual std::shared_ptr<const TlsReload> tls() const = 0;

  // Health becomes SERVING, as it is at the start, or NOT_SERVING. Calls are
  // answered all the same.
  virtual void SetServing(bool serving) = 0;

  // Stops the server and the API. Health becomes NOT_SERVING, and no new call
  // is accepted. Watches, and streams between segments, end with UNAVAILABLE
  // soon; calls that remain after the deadline are cancelled. When it returns,
  // no handler runs. A second call does nothing.
  virtual void Shutdown(std::chrono::milliseconds deadline) = 0;
};

// Starts a server; `api` must outlive it. Errors are those of
// CheckServerOptions; UNAVAILABLE if it cannot listen on an address.
//
// `tls_refused` is called, on a thread of the server, with the reason why
// changed TLS files are not taken up, once for each change.
absl::StatusOr<std::unique_ptr<Server>> MakeServer(
    Api* api,
    const ServerOptions& options,
    const std::function<void(const std::string&)>& tls_refused = {});

}  // namespace selfcal::server
