// Errors as responses in JSON.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "server/http/http.h"

namespace selfcal::server {

// A response {"code": "NOT_FOUND", "message": ..., "whatToDo": ...}.
HttpResponse ErrorResponse(const absl::Status& status);

// The same as a server-sent event.
std::string ErrorEvent(const absl::Status& status);

}  // namespace selfcal::server
