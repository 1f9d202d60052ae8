#include "server/http/policy.h"

#include <string>

#include "server/access/loopback_host.h"

namespace selfcal::server {
namespace {

std::string HeaderOf(const HttpRequest& request, const char* name) {
  const auto found = request.headers.find(name);
  return found == request.headers.end() ? "" : found->second;
}

}  // namespace

const std::array<Header, 6>& SecurityHeaders() {
  static constexpr std::array<Header, 6> kHeaders = {{
      {"Content-Security-Policy",
       "default-src 'self'; img-src 'self' data:; object-src 'none'; "
       "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"X-Frame-Options", "DENY"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Cache-Control", "no-store"},
  }};
  return kHeaders;
}

absl::Status CheckHost(const HttpRequest& request, bool loopback) {
  if (!loopback || IsLoopbackHost(HeaderOf(request, "host"))) {
    return absl::OkStatus();
  }
  return absl::PermissionDeniedError(
      "on the loopback interface this can only be opened as 127.0.0.1, "
      "localhost or [::1]; a proxy has to set the header Host");
}

}  // namespace selfcal::server
