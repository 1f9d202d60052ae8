// The gRPC server: the five services, grpc.health.v1 and reflection, on unix
// sockets or TCP ports.
//
// There is no encryption and no authentication: who can open the socket or
// reach the port may do everything. Any thread may call.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/pipeline/pipeline.h"
#include "server/store/store.h"

namespace selfcal::server {

struct ServerOptions {
  // "unix:/path" or "host:port"; port 0 takes a free one.
  std::vector<std::string> listen;
  int max_receive_bytes = 64 << 20;  // of one message
  // Every watch holds a thread; calls beyond are refused with
  // RESOURCE_EXHAUSTED, as are streams of segments beyond theirs.
  int max_threads = 128;
  int max_streams = 256;
  std::int64_t max_memory_bytes = 512 << 20;  // of messages in flight
};

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

// Starts a server; `store` and `pipeline` must outlive it. `restored` is called
// on one of its threads when a restored database waits for the next start.
// INVALID_ARGUMENT without an address; UNAVAILABLE if one cannot be listened
// on.
absl::StatusOr<std::unique_ptr<Server>> MakeServer(
    Store* store,
    Pipeline* pipeline,
    const ServerOptions& options,
    std::function<void()> restored = nullptr);

}  // namespace selfcal::server
