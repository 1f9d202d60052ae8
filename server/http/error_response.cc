#include "server/http/error_response.h"

#include <nlohmann/json.hpp>
#include <string>

namespace selfcal::server {
namespace {

struct Kind {
  int status;
  const char* what_to_do;
};

Kind KindOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kInvalidArgument:
      return {400, "Correct the address or the request."};
    case absl::StatusCode::kOutOfRange:
      return {413, "Send a smaller request."};
    case absl::StatusCode::kUnauthenticated:
      return {401, "Import a client certificate into the browser."};
    case absl::StatusCode::kPermissionDenied:
      return {403, "Ask the operator for the required role."};
    case absl::StatusCode::kNotFound:
      return {404, "Check the name against the list."};
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kAborted:
      return {409, "Reload the page to see the current state."};
    case absl::StatusCode::kResourceExhausted:
    case absl::StatusCode::kUnavailable:
      return {503, "Try again in a moment."};
    case absl::StatusCode::kUnimplemented:
      return {405, "Use a method that this address supports."};
    case absl::StatusCode::kDataLoss:
      return {500, "Run 'selfcal daemon doctor', and restore a backup."};
    default:
      return {500, "See the log of selfcald, and report this."};
  }
}

}  // namespace

HttpResponse ErrorResponse(const absl::Status& status) {
  const Kind kind = KindOf(status.code());
  const nlohmann::json body = {
      {"code", absl::StatusCodeToString(status.code())},
      {"message", std::string(status.message())},
      {"whatToDo", kind.what_to_do}};
  HttpResponse response;
  response.status = kind.status;
  // Messages may quote bytes of the request that are not valid UTF-8.
  response.body =
      body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return response;
}

std::string ErrorEvent(const absl::Status& status) {
  return "event: error\ndata: " + ErrorResponse(status).body + "\n\n";
}

}  // namespace selfcal::server
