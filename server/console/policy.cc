#include "server/console/policy.h"

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

absl::Status CheckOrigin(const HttpRequest& request, bool loopback) {
  if (loopback && !IsLoopbackHost(HeaderOf(request, "host"))) {
    return absl::PermissionDeniedError(
        "on the loopback interface the console can only be opened as "
        "127.0.0.1, "
        "localhost or [::1]");
  }
  if (request.method == "GET" || request.method == "HEAD") {
    return absl::OkStatus();
  }
  if (request.method != "POST" && request.method != "PATCH" &&
      request.method != "DELETE") {
    return absl::UnimplementedError(
        "the console supports only GET, HEAD, POST, PATCH and DELETE");
  }
  if (HeaderOf(request, "x-selfcal-console").empty()) {
    return absl::PermissionDeniedError(
        "a change requires the header X-Selfcal-Console: 1, which the pages of "
        "the console send");
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
