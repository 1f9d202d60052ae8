// A method of the contract with its handler, for any transport. What is called
// here checks the access rule of the method and never throws.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <variant>

#include "server/api/call.h"
#include "server/api/watch_queue.h"

namespace selfcal::server {

using google::protobuf::Message;

// One request, one response.
using UnaryHandler = std::function<absl::Status(
    const Call& call, const Message& request, Message* response)>;

// One request, many responses, which the handler computes on its thread.
// `write` waits until the response is sent; false: the caller has disconnected
// or the daemon is stopping, and the handler should return.
using WriteResponse = std::function<bool(const Message& response)>;
using StreamingHandler = std::function<absl::Status(
    const Call& call, const Message& request, const WriteResponse& write)>;

// One request, then updates as they happen, which arrive in the queue until it
// is closed or the reader destroys what is returned. Occupies no thread.
using WatchHandler = std::function<absl::StatusOr<std::shared_ptr<void>>(
    const Call& call,
    const Message& request,
    const std::shared_ptr<WatchQueue>& queue)>;

// Many requests, one response. `read` waits for a request; false: there are no
// more.
using ReadRequest = std::function<bool(Message* request)>;
using UploadHandler = std::function<absl::Status(
    const Call& call, const ReadRequest& read, Message* response)>;

// Many requests, each with its response. An error ends the exchange.
class Exchange {
 public:
  virtual ~Exchange() = default;
  using Done =
      std::function<void(absl::Status status, const Message& response)>;
  // Processes one request; only one thread may call. May wait. `done` is called
  // once: on this thread, or on another that must not be blocked.
  virtual void Take(const Message& request, const Done& done) = 0;
};
// Returns the state of one exchange; it must be destroyed before `call`.
using ExchangeHandler =
    std::function<std::unique_ptr<Exchange>(const Call& call)>;

struct Method {
  const google::protobuf::MethodDescriptor* descriptor = nullptr;
  const Message* request = nullptr;  // default instances
  const Message* response = nullptr;
  std::variant<UnaryHandler,
               StreamingHandler,
               WatchHandler,
               UploadHandler,
               ExchangeHandler>
      handler;
  // Bytes that the handler takes for what it parses from the request; null:
  // none. Only methods with one request and one response have it.
  std::function<std::int64_t(const Message& request)> work = nullptr;
};

}  // namespace selfcal::server
