// How each address is opened: unix sockets with permissions, TCP with mutual
// TLS, and plain TCP only where it is asked for by name.
//
//   unix:/path          who may open the file
//   host:port           who has a certificate of the client authority
//   insecure:host:port  anybody who reaches the port
#pragma once

#include <absl/status/status.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "server/service/server.h"

namespace selfcal::server {

// What gRPC is told, and what its file is for a unix socket.
struct Endpoint {
  std::string address;
  bool tls = false;
  std::string socket;  // path; empty for TCP
};

Endpoint ParseEndpoint(const std::string& address);

// Reads the files anew when they change; CheckServerOptions has passed.
std::shared_ptr<grpc::ServerCredentials> TlsCredentials(
    const TlsOptions& options);

// Gives a socket that is open its group and mode.
absl::Status SetPermissions(const std::string& path,
                            const SocketOptions& options);

}  // namespace selfcal::server
