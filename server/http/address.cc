#include "server/http/address.h"

#include <arpa/inet.h>

#include <charconv>
#include <cstdint>
#include <cstring>

namespace selfcal::server {
namespace {

constexpr std::uint8_t kLoopbackNet = 127;

absl::Status Bad(const std::string& text) {
  return absl::InvalidArgumentError(
      "'" + text +
      "' is not a numeric address with a port, such as 127.0.0.1:7448 or "
      "[::1]:7448");
}

}  // namespace

absl::StatusOr<SocketAddress> ParseSocketAddress(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == text.npos) return Bad(text);
  std::uint16_t port = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] =
      std::from_chars(text.data() + colon + 1, end, port);
  if (error != std::errc() || rest != end) return Bad(text);

  SocketAddress address;
  address.host = text.substr(0, colon);
  address.ipv6 = address.host.starts_with('[') && address.host.ends_with(']');
  if (address.ipv6) {
    sockaddr_in6 six{};
    six.sin6_family = AF_INET6;
    six.sin6_port = htons(port);
    const std::string host = address.host.substr(1, address.host.size() - 2);
    if (inet_pton(AF_INET6, host.c_str(), &six.sin6_addr) != 1) {
      return Bad(text);
    }
    address.loopback = IN6_IS_ADDR_LOOPBACK(&six.sin6_addr);
    std::memcpy(&address.bytes, &six, sizeof(six));
    return address;
  }
  sockaddr_in four{};
  four.sin_family = AF_INET;
  four.sin_port = htons(port);
  if (inet_pton(AF_INET, address.host.c_str(), &four.sin_addr) != 1) {
    return Bad(text);
  }
  address.loopback = ntohl(four.sin_addr.s_addr) >> 24 == kLoopbackNet;
  std::memcpy(&address.bytes, &four, sizeof(four));
  return address;
}

}  // namespace selfcal::server
