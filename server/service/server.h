// The gRPC server: the six services, grpc.health.v1 and reflection, on unix
// sockets or TCP ports (credentials.h says how each is opened). What a caller
// may do is in server/access; health and reflection are for all who connect.
// Any thread may call.
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
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

// Of unix sockets. The folder is a gate of its own.
struct SocketOptions {
  std::string group;     // empty: that of the process
  unsigned mode = 0660;  // who may write may connect

  friend bool operator==(const SocketOptions&, const SocketOptions&) = default;
};

struct ServerOptions {
  // "unix:/path", "host:port" or "insecure:host:port"; port 0 takes a free one.
  std::vector<std::string> listen;
  TlsOptions tls;
  SocketOptions socket;
  // Of callers without a certificate: over unix sockets and insecure ports.
  Role local_role = Role::kAdminister;
  int max_receive_bytes = 64 << 20;  // of one message
  // Every watch holds a thread; calls beyond are refused with
  // RESOURCE_EXHAUSTED, as are streams of segments beyond theirs.
  int max_threads = 128;
  int max_segment_streams = 256;
  std::int64_t max_memory_bytes = 512 << 20;  // of messages in flight
  int max_streams = 100;  // calls at once on one connection; more wait
  std::int64_t max_rigs = 10'000;

  friend bool operator==(const ServerOptions&, const ServerOptions&) = default;
};

// Whether a server could be opened with these: INVALID_ARGUMENT without an
// address, for one of TCP without TLS, or for an unknown group;
// FAILED_PRECONDITION for files of TLS that cannot be used. Opens nothing.
absl::Status CheckServerOptions(const ServerOptions& options);

class Server {
 public:
  virtual ~Server() = default;  // as Shutdown without time

  // The addresses with the ports that were taken, as a client names them.
  virtual const std::vector<std::string>& addresses() const = 0;

  // Health turns to NOT_SERVING and no new call is taken. Watches and streams
  // that are between segments end with UNAVAILABLE at their next turn, what is
  // left after the deadline is cancelled. When it returns no handler runs. A
  // second call does nothing.
  virtual void Shutdown(std::chrono::milliseconds deadline) = 0;
};

// Starts a server; `domain` and `pipeline` must outlive it. `restored` is
// called on one of its threads when a restored database waits for the next
// start. Errors of CheckServerOptions; UNAVAILABLE if an address cannot be
// listened on.
absl::StatusOr<std::unique_ptr<Server>> MakeServer(
    Domain* domain,
    Pipeline* pipeline,
    const ServerOptions& options,
    std::function<void()> restored = nullptr);

}  // namespace selfcal::server
