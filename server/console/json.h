// Messages of the contract as responses in JSON.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "server/http/http.h"

namespace selfcal::server {

// A response with all fields of a message; names are in camel case, 64-bit
// integers are strings.
HttpResponse JsonResponse(const google::protobuf::Message& message);

// The same as a server-sent event.
std::string MessageEvent(const google::protobuf::Message& message);

}  // namespace selfcal::server
