// Who calls, for the event log.
#pragma once

#include <grpcpp/server_context.h>

#include <string>

namespace selfcal::server {

// The address of the peer: "unix:" for the local socket.
inline std::string CallerName(const grpc::ServerContext& call) {
  return call.peer();
}

}  // namespace selfcal::server
