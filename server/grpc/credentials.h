// Security of the addresses: unix sockets with permissions, TCP with mutual
// TLS, and plain TCP only if it is requested explicitly. Access is granted to
//
//   unix:/path          users who may open the file
//   host:port           clients with a certificate of the client authority
//   insecure:host:port  anybody who reaches the port
#pragma once

#include <absl/status/status.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "server/access/tls_reload.h"
#include "server/grpc/server.h"

namespace selfcal::server {

// An address for gRPC and, for a unix socket, the path of its file.
struct Endpoint {
  std::string address;
  bool tls = false;
  std::string socket;  // path; empty for TCP
};

Endpoint ParseEndpoint(const std::string& address);

// Returns credentials, which must outlive the server, that use the files in
// force at the begin of a connection, and require a certificate of the client
// authority.
std::shared_ptr<grpc::ServerCredentials> TlsCredentials(
    std::shared_ptr<const TlsReload> tls);

// Sets group and mode of an open socket.
absl::Status SetPermissions(const std::string& path,
                            const SocketOptions& options);

}  // namespace selfcal::server
