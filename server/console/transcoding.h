// The API as JSON over HTTP, under /api: requests and responses are those of
// gRPC in the JSON of protobuf. Streams are server-sent events, one for each
// message; an error that ends a stream is an event of type `error`.
#pragma once

#include "server/api/api.h"
#include "server/console/routes.h"
#include "server/http/http.h"

namespace selfcal::server {

class Transcoding {
 public:
  // `api` must outlive it.
  explicit Transcoding(const Api* api) : routes_(*api) {}

  // Never throws; every error is a response. Any thread may call.
  HttpResponse Answer(const HttpRequest& request) const;

 private:
  Routes routes_;
};

}  // namespace selfcal::server
