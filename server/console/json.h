// Answers in JSON: messages of the contract as gRPC has them, and errors.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include "server/console/http.h"

namespace selfcal::server {

// Every field, names in camel case, 64-bit integers as strings.
HttpResponse JsonResponse(const google::protobuf::Message& message);

// {"code": "NOT_FOUND", "message": ..., "whatToDo": ...}
HttpResponse ErrorResponse(const absl::Status& status);

}  // namespace selfcal::server
