// An HTTP request and its response.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/access/grants.h"

namespace selfcal::server {

struct HttpRequest {
  std::string method;
  std::string path;  // decoded once
  std::map<std::string, std::string> query;
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
  Caller caller;
};

// The part of a response that is sent as it is made. Any thread may call Close.
class HttpStream {
 public:
  virtual ~HttpStream() = default;
  // Waits for at most `timeout` for bytes to send. Empty: none so far; nullopt:
  // the stream has ended.
  virtual std::optional<std::string> Take(
      std::chrono::milliseconds timeout) = 0;
  // Ends the stream soon.
  virtual void Close() = 0;
};

struct HttpResponse {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
  // If set, sent after the body, until it ends or the client has disconnected.
  std::shared_ptr<HttpStream> stream = nullptr;
};

using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

}  // namespace selfcal::server
