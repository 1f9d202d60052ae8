// The handlers of the methods, by service, and how they are added to the API.
// Internal to server/api.
#pragma once

#include <exception>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "server/api/context.h"
#include "server/api/errors.h"
#include "server/api/method.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

// Sends a response of a streaming method (method.h).
template <typename Response>
using Writer = std::function<bool(const Response& response)>;
// Reads a request of an upload (method.h).
template <typename Request>
using Reader = std::function<bool(Request* request)>;

// Updates for one watcher (watch_queue.h).
template <typename Response>
class Watch {
 public:
  // Writes the update; returns false if there is nothing to send.
  using Encode = std::function<absl::StatusOr<bool>(Response* update)>;
  // Returns an update that other watches may send as well.
  using Share = WatchQueue::Encode;

  explicit Watch(std::shared_ptr<WatchQueue> queue)
      : queue_(std::move(queue)) {}

  void Put(const std::string& key, Encode encode) const {
    queue_->Put(key, Erased(std::move(encode)));
  }
  void PutShared(const std::string& key, Share share) const {
    queue_->Put(key, std::move(share));
  }
  void SetSummary(Encode encode) const {
    queue_->SetSummary(Erased(std::move(encode)));
  }
  void Close() const { queue_->Close(); }

 private:
  static WatchQueue::Encode Erased(Encode encode) {
    return
        [encode = std::move(
             encode)]() -> absl::StatusOr<std::shared_ptr<const WatchUpdate>> {
          auto message = std::make_unique<Response>();
          SELFCAL_ASSIGN_OR_RETURN(const bool send, encode(message.get()));
          if (!send) return nullptr;
          return std::make_shared<const WatchUpdate>(std::move(message));
        };
  }

  std::shared_ptr<WatchQueue> queue_;
};

// Collects the methods. A handler is a function of one of the forms below; the
// type of its request identifies the method, because each method has a type of
// its own. Access is checked, and exceptions become errors, around each.
class Methods {
 public:
  explicit Methods(const ApiContext& context) : context_(context) {}

  // `work`: Method::work.
  template <typename Request, typename Response>
  void Add(absl::StatusOr<Response> (*handler)(const ApiContext&,
                                               const Call&,
                                               const Request&),
           std::int64_t (*work)(const Request&) = nullptr) {
    Method method = Of<Request, Response>();
    if (work != nullptr) {
      method.work = [work](const Message& request) {
        return work(static_cast<const Request&>(request));
      };
    }
    AddUnary(std::move(method),
             [context = context_, handler](
                 const Call& call, const Message& request, Message* response) {
               auto answer =
                   handler(context, call, static_cast<const Request&>(request));
               if (!answer.ok()) return answer.status();
               *static_cast<Response*>(response) = *std::move(answer);
               return absl::OkStatus();
             });
  }

  template <typename Request, typename Response>
  void Add(absl::Status (*handler)(const ApiContext&,
                                   const Call&,
                                   const Request&,
                                   const Writer<Response>&)) {
    AddStreaming(
        Of<Request, Response>(),
        [context = context_, handler](const Call& call,
                                      const Message& request,
                                      const WriteResponse& write) {
          return handler(
              context, call, static_cast<const Request&>(request), write);
        });
  }

  template <typename Request, typename Response>
  void Add(absl::StatusOr<std::shared_ptr<void>> (*handler)(
      const ApiContext&, const Call&, const Request&, const Watch<Response>&)) {
    AddWatch(Of<Request, Response>(),
             [context = context_, handler](
                 const Call& call,
                 const Message& request,
                 const std::shared_ptr<WatchQueue>& queue) {
               return handler(context,
                              call,
                              static_cast<const Request&>(request),
                              Watch<Response>(queue));
             });
  }

  template <typename Request, typename Response>
  void Add(absl::StatusOr<Response> (*handler)(const ApiContext&,
                                               const Call&,
                                               const Reader<Request>&)) {
    AddUpload(
        Of<Request, Response>(),
        [context = context_, handler](
            const Call& call, const ReadRequest& read, Message* response) {
          auto answer = handler(context, call, read);
          if (!answer.ok()) return answer.status();
          *static_cast<Response*>(response) = *std::move(answer);
          return absl::OkStatus();
        });
  }

  template <typename Request, typename Response>
  void AddExchange(std::unique_ptr<Exchange> (*handler)(const ApiContext&,
                                                        const Call&)) {
    AddExchange(Of<Request, Response>(),
                [context = context_, handler](const Call& call) {
                  return handler(context, call);
                });
  }

  std::vector<Method> Take() { return std::move(methods_); }

 private:
  template <typename Request, typename Response>
  static Method Of() {
    return Method{nullptr,
                  &Request::default_instance(),
                  &Response::default_instance(),
                  UnaryHandler(),
                  nullptr};
  }

  // They fill in the descriptor and the checks around the handler.
  void AddUnary(Method method, UnaryHandler handler);
  void AddStreaming(Method method, StreamingHandler handler);
  void AddWatch(Method method, WatchHandler handler);
  void AddUpload(Method method, UploadHandler handler);
  void AddExchange(Method method, ExchangeHandler handler);

  const ApiContext context_;
  std::vector<Method> methods_;
};

// The method with this type of request, in the file of its service.
const google::protobuf::MethodDescriptor* MethodOf(const Message& request);

void AddRigMethods(Methods* methods);
void AddSegmentMethods(Methods* methods);
void AddSessionMethods(Methods* methods);
void AddCalibrationMethods(Methods* methods);
void AddRecalibrationMethods(Methods* methods);
void AddStoreMethods(Methods* methods);
void AddActivityMethods(Methods* methods);
void AddFleetMethods(Methods* methods);
void AddUplinkMethods(Methods* methods);

}  // namespace selfcal::server
