// The addresses of the methods: their option google.api.http, under /api. Any
// thread may call.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/api/api.h"
#include "server/http/http.h"

namespace selfcal::server {

class Routes {
 public:
  // `api` must outlive it.
  explicit Routes(const Api& api);

  // A method, and the request to it.
  struct Request {
    const Method* method = nullptr;
    std::unique_ptr<Message> message;
  };
  // The request that an address, its query and the body make. NOT_FOUND for an
  // unknown address; UNIMPLEMENTED for one that has no such HTTP method;
  // INVALID_ARGUMENT for a parameter or body that does not fit the request.
  absl::StatusOr<Request> Find(const HttpRequest& request) const;

 private:
  // One part of a path between slashes.
  struct Part {
    std::string literal;  // empty: any text
    std::string field;    // path of the field that it belongs to, or empty
  };
  struct Route {
    std::string http_method;
    std::vector<Part> parts;
    std::string verb;  // after a colon at the end, or empty
    std::string body;  // field that the body has; "*": the request itself
    const Method* method = nullptr;
  };

  static Route ParseTemplate(std::string_view path);
  static std::optional<std::map<std::string, std::string>> Match(
      const Route& route, std::string_view path);

  std::vector<Route> routes_;  // those with a verb first
};

}  // namespace selfcal::server
