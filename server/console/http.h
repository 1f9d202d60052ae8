// A request and its answer, as the console sees them.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/access/grants.h"
#include "server/console/outbox.h"

namespace selfcal::server {

struct HttpRequest {
  std::string method;
  std::string path;  // decoded once
  std::map<std::string, std::string> query;
  std::map<std::string, std::string> headers;  // names in small letters
  std::string body;
  Caller caller;
};

struct HttpResponse {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
  // Goes on after the body until it is closed or its reader has gone.
  std::shared_ptr<Outbox> stream = nullptr;
  // Lives as long as the answer is sent.
  std::shared_ptr<void> keep = nullptr;
};

using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

}  // namespace selfcal::server
