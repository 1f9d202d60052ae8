// A numeric host:port, for sockets.
#pragma once

#include <absl/status/statusor.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

namespace selfcal::server {

struct SocketAddress {
  sockaddr_storage bytes{};
  bool ipv6 = false;
  bool loopback = false;
  std::string host;  // as in a URL

  const sockaddr* get() const {
    return reinterpret_cast<const sockaddr*>(&bytes);
  }
};

// Parses e.g. "127.0.0.1:7448" or "[::1]:7448". INVALID_ARGUMENT for anything
// else.
absl::StatusOr<SocketAddress> ParseSocketAddress(const std::string& text);

}  // namespace selfcal::server
