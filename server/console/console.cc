#include "server/console/console.h"

#include <algorithm>
#include <utility>

#include "server/console/assets.h"
#include "server/console/transcoding.h"
#include "server/http/error_response.h"
#include "server/http/http_server.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

HttpOptions HttpOf(const ConsoleOptions& options) {
  return {"console", options.address, options.tls, options.local_role};
}

// PERMISSION_DENIED for a change without the header X-Selfcal-Console, which
// pages of other sites cannot send. UNIMPLEMENTED for methods other than GET,
// HEAD, POST, PATCH and DELETE.
absl::Status CheckMethod(const HttpRequest& request) {
  if (request.method == "GET" || request.method == "HEAD") {
    return absl::OkStatus();
  }
  if (request.method != "POST" && request.method != "PATCH" &&
      request.method != "DELETE") {
    return absl::UnimplementedError(
        "only GET, HEAD, POST, PATCH and DELETE are supported");
  }
  if (!request.headers.contains("x-selfcal-console")) {
    return absl::PermissionDeniedError(
        "a change requires the header X-Selfcal-Console: 1, which the pages of "
        "the console send");
  }
  return absl::OkStatus();
}

HttpResponse AnswerPage(const HttpRequest& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    return ErrorResponse(
        absl::UnimplementedError("pages can only be read, with GET"));
  }
  const auto assets = Assets();
  const auto found =
      std::find_if(assets.begin(), assets.end(), [&](const Asset& asset) {
        return asset.path == request.path;
      });
  if (found == assets.end() && request.path.starts_with("/assets/")) {
    return ErrorResponse(absl::NotFoundError("there is no such file"));
  }
  const Asset& asset = found == assets.end() ? assets.front() : *found;
  HttpResponse response;
  response.type = asset.type;
  response.body = asset.bytes;
  return response;
}

class HttpConsole final : public Console {
 public:
  explicit HttpConsole(const Api* api) : transcoding_(api) {}

  absl::Status Start(const HttpOptions& options) {
    SELFCAL_ASSIGN_OR_RETURN(
        server_, MakeHttpServer(options, [this](const HttpRequest& request) {
          const absl::Status allowed = CheckMethod(request);
          if (!allowed.ok()) return ErrorResponse(allowed);
          return request.path.starts_with("/api/")
                     ? transcoding_.Answer(request)
                     : AnswerPage(request);
        }));
    return absl::OkStatus();
  }

  const std::string& url() const override { return server_->url(); }

 private:
  const Transcoding transcoding_;
  std::unique_ptr<HttpServer> server_;
};

}  // namespace

absl::Status CheckConsole(const ConsoleOptions& options) {
  return CheckHttpOptions(HttpOf(options));
}

absl::StatusOr<std::unique_ptr<Console>> MakeConsole(
    const Api* api, const ConsoleOptions& options) {
  auto console = std::make_unique<HttpConsole>(api);
  SELFCAL_RETURN_IF_ERROR(console->Start(HttpOf(options)));
  return console;
}

}  // namespace selfcal::server
