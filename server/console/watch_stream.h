// A watch as a stream of server-sent events. Internal to server/console.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "server/api/method.h"
#include "server/http/http.h"

namespace selfcal::server {

// Errors of the method, whose handler must be a WatchHandler.
absl::StatusOr<std::shared_ptr<HttpStream>> OpenWatchStream(
    const Method& method, const Call& call, const Message& request);

}  // namespace selfcal::server
