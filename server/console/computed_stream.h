// The responses of a streaming method as server-sent events. Internal to
// server/console.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "server/api/method.h"
#include "server/http/http.h"

namespace selfcal::server {

// Starts the method, whose handler must be a StreamingHandler, on a thread of
// its own, and waits for its first response. The error of the method if it has
// failed before; RESOURCE_EXHAUSTED if there is no thread.
absl::StatusOr<std::shared_ptr<HttpStream>> OpenComputedStream(
    const Method& method, const Caller& caller, const Message& request);

}  // namespace selfcal::server
