// What is under /api/v1: the contract read over HTTP, in its own messages and
// under the same rules of access. Any thread may call.
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

// Never throws; every mistake is an answer.
HttpResponse AnswerApi(const ApiContext& context, const HttpRequest& request);

}  // namespace selfcal::server
