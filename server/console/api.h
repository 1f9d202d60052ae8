// The HTTP API under /api/v1: the contract with its own messages and the same
// access rules. Any thread may call.
#pragma once

#include <string>

#include "server/console/change_feed.h"
#include "server/console/http.h"
#include "server/pipeline/pipeline.h"
#include "server/store/store.h"

namespace selfcal::server {

struct ApiContext {
  Store* store = nullptr;
  Pipeline* pipeline = nullptr;
  ChangeFeed* feed = nullptr;
  std::string program_version;
};

// Handles a request. Never throws; errors are responses.
HttpResponse AnswerApi(const ApiContext& context, const HttpRequest& request);

}  // namespace selfcal::server
