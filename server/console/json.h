// Responses in JSON: messages of the contract, and errors.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <string>

#include "server/console/http.h"

namespace selfcal::server {

// A response with all fields of a message; names are in camel case, 64-bit
// integers are strings.
HttpResponse JsonResponse(const google::protobuf::Message& message);

// A response {"code": "NOT_FOUND", "message": ..., "whatToDo": ...}.
HttpResponse ErrorResponse(const absl::Status& status);

// The same as server-sent events.
std::string MessageEvent(const google::protobuf::Message& message);
std::string ErrorEvent(const absl::Status& status);

}  // namespace selfcal::server
