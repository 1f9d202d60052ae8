// Responses in JSON: messages of the contract, and errors.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include "server/console/http.h"

namespace selfcal::server {

// A response with all fields of a message; names are in camel case, 64-bit
// integers are strings.
HttpResponse JsonResponse(const google::protobuf::Message& message);

// A response {"code": "NOT_FOUND", "message": ..., "whatToDo": ...}.
HttpResponse ErrorResponse(const absl::Status& status);

}  // namespace selfcal::server
