#include "server/console/json.h"

#include <google/protobuf/util/json_util.h>

#include <string>

#include "server/http/error_response.h"

namespace selfcal::server {
HttpResponse JsonResponse(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  HttpResponse response;
  const auto written = google::protobuf::util::MessageToJsonString(
      message, &response.body, options);
  if (!written.ok()) {
    return ErrorResponse(absl::InternalError(written.ToString()));
  }
  return response;
}

std::string MessageEvent(const google::protobuf::Message& message) {
  return "data: " + JsonResponse(message).body + "\n\n";
}

}  // namespace selfcal::server
