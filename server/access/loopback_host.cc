#include "server/access/loopback_host.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace selfcal::server {
namespace {

// Returns the host without the port; empty if something else follows it, as in
// "[::1].example.org".
std::string_view WithoutPort(std::string_view host) {
  const std::size_t size = std::min(
      host.starts_with('[') ? host.find(']') + 1 : host.find(':'), host.size());
  const std::string_view port = host.substr(size);
  const bool is_port =
      port.empty() ||
      (port[0] == ':' &&
       port.find_first_not_of("0123456789", 1) == std::string_view::npos);
  return is_port ? host.substr(0, size) : std::string_view();
}

}  // namespace

bool IsLoopbackHost(std::string_view host) {
  constexpr std::string_view kNames[] = {"127.0.0.1", "localhost", "[::1]"};
  return std::find(std::begin(kNames), std::end(kNames), WithoutPort(host)) !=
         std::end(kNames);
}

}  // namespace selfcal::server
