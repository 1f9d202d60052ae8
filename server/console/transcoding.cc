#include "server/console/transcoding.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <memory>
#include <new>
#include <utility>
#include <variant>

#include "server/api/errors.h"
#include "server/console/computed_stream.h"
#include "server/console/json.h"
#include "server/console/watch_stream.h"
#include "server/http/error_response.h"

namespace selfcal::server {
namespace {

HttpResponse StreamResponse(std::shared_ptr<HttpStream> stream) {
  HttpResponse response;
  response.type = "text/event-stream";
  response.stream = std::move(stream);
  return response;
}

HttpResponse Invoke(const Routes::Request& request, const Caller& caller) {
  const Call call{caller};
  const auto& handler = request.method->handler;
  if (const auto* unary = std::get_if<UnaryHandler>(&handler)) {
    const std::unique_ptr<Message> response(request.method->response->New());
    const absl::Status status =
        (*unary)(call, *request.message, response.get());
    return status.ok() ? JsonResponse(*response) : ErrorResponse(status);
  }
  if (std::holds_alternative<WatchHandler>(handler)) {
    auto stream = OpenWatchStream(*request.method, call, *request.message);
    return stream.ok() ? StreamResponse(*std::move(stream))
                       : ErrorResponse(stream.status());
  }
  if (std::holds_alternative<StreamingHandler>(handler)) {
    auto stream = OpenComputedStream(*request.method, caller, *request.message);
    return stream.ok() ? StreamResponse(*std::move(stream))
                       : ErrorResponse(stream.status());
  }
  return ErrorResponse(absl::UnimplementedError(
      "this method needs a stream of requests: call it over gRPC"));
}

}  // namespace

HttpResponse Transcoding::Answer(const HttpRequest& request) const {
  try {
    const auto found = routes_.Find(request);
    return found.ok() ? Invoke(*found, request.caller)
                      : ErrorResponse(found.status());
  } catch (const std::bad_alloc&) {
    return ErrorResponse(absl::ResourceExhaustedError("out of memory"));
  } catch (const std::exception& error) {
    spdlog::error("console: {}", error.what());
    return ErrorResponse(absl::InternalError("the log says more"));
  }
}

}  // namespace selfcal::server
