// A request to the console and its response.
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
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
  Caller caller;
};

struct HttpResponse {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
  // If set, its lines are sent after the body, until it is closed or the client
  // has disconnected.
  std::shared_ptr<Outbox> stream = nullptr;
  // An object that must live until the response is sent.
  std::shared_ptr<void> keep = nullptr;
};

using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

}  // namespace selfcal::server
