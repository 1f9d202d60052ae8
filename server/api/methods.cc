#include "server/api/methods.h"

#include <google/protobuf/descriptor.h>
#include <spdlog/spdlog.h>

#include <array>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "server/access/grants.h"
#include "server/access/rules.h"
#include "server/api/rig_watches.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

using google::protobuf::MethodDescriptor;

absl::Status Authorised(const ApiContext& context,
                        const Call& call,
                        const MethodDescriptor& method,
                        const Message& request,
                        const std::string& rig_of_stream = "") {
  absl::Status status = Authorise(
      call.caller,
      method,
      request,
      [&context](const std::string& rig)
          -> absl::StatusOr<std::map<std::string, std::string>> {
        SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored,
                                 context.store->GetRig(rig));
        return stored.labels;
      },
      rig_of_stream);
  if (!status.ok()) {
    spdlog::debug("denied to '{}': {}", call.caller.name, method.full_name());
  }
  return status;
}

// Runs a handler; no exception leaves it, and an error is one for a client. The
// result is a Status or a StatusOr.
template <typename Handler>
auto Guarded(const ApiContext& context, const Handler& handler)
    -> decltype(handler()) {
  absl::Status failed;
  try {
    auto result = handler();
    if constexpr (std::is_same_v<decltype(result), absl::Status>) {
      failed = result;
    } else {
      failed = result.status();
    }
    if (failed.ok()) return result;
  } catch (const std::bad_alloc&) {
    failed = absl::ResourceExhaustedError("out of memory; send less at once");
  } catch (const std::exception& error) {
    failed = absl::InternalError(error.what());
  }
  return context.stopping->load() ? ShuttingDown() : ForClient(failed);
}

// Checks access to each request of an exchange.
class AuthorisedExchange final : public Exchange {
 public:
  AuthorisedExchange(const ApiContext& context,
                     const Call& call,
                     const MethodDescriptor& method,
                     const Message& response,
                     std::unique_ptr<Exchange> exchange)
      : context_(context),
        call_(call),
        method_(method),
        response_(response),
        exchange_(std::move(exchange)) {}

  void Take(const Message& request, const Done& done) override {
    const absl::Status refused = Guarded(context_, [&] {
      // Each time, since the labels of a rig may change.
      const absl::Status may =
          Authorised(context_, call_, method_, request, rig_);
      if (!may.ok()) return may;
      if (rig_.empty()) rig_ = RigOf(method_, request);
      exchange_->Take(request, done);
      return absl::OkStatus();
    });
    if (!refused.ok()) done(refused, response_);
  }

 private:
  const ApiContext& context_;
  const Call& call_;
  const MethodDescriptor& method_;
  const Message& response_;
  std::unique_ptr<Exchange> exchange_;
  std::string rig_;  // that the first request named
};

}  // namespace

const MethodDescriptor* MethodOf(const Message& request) {
  const auto& file = *request.GetDescriptor()->file();
  for (int s = 0; s < file.service_count(); ++s) {
    for (int m = 0; m < file.service(s)->method_count(); ++m) {
      const MethodDescriptor* method = file.service(s)->method(m);
      if (method->input_type() == request.GetDescriptor()) return method;
    }
  }
  throw std::logic_error(request.GetTypeName() +
                         " is not the request of a method");
}

void Methods::AddUnary(Method method, UnaryHandler handler) {
  method.descriptor = MethodOf(*method.request);
  method.handler = UnaryHandler(
      [this_method = method.descriptor,
       context = context_,
       handler = std::move(handler)](
          const Call& call, const Message& request, Message* response) {
        return Guarded(context, [&] {
          absl::Status status =
              Authorised(context, call, *this_method, request);
          return status.ok() ? handler(call, request, response) : status;
        });
      });
  methods_.push_back(std::move(method));
}

void Methods::AddStreaming(Method method, StreamingHandler handler) {
  method.descriptor = MethodOf(*method.request);
  method.handler = StreamingHandler([this_method = method.descriptor,
                                     context = context_,
                                     handler = std::move(handler)](
                                        const Call& call,
                                        const Message& request,
                                        const WriteResponse& write) {
    return Guarded(context, [&] {
      absl::Status status = Authorised(context, call, *this_method, request);
      if (!status.ok()) return status;
      return handler(call, request, [&](const Message& response) {
        return !context.stopping->load() && write(response);
      });
    });
  });
  methods_.push_back(std::move(method));
}

void Methods::AddWatch(Method method, WatchHandler handler) {
  method.descriptor = MethodOf(*method.request);
  method.handler = WatchHandler([this_method = method.descriptor,
                                 context = context_,
                                 handler = std::move(handler)](
                                    const Call& call,
                                    const Message& request,
                                    const std::shared_ptr<WatchQueue>& queue)
                                    -> absl::StatusOr<std::shared_ptr<void>> {
    return Guarded(context, [&]() -> absl::StatusOr<std::shared_ptr<void>> {
      absl::Status status = Authorised(context, call, *this_method, request);
      if (!status.ok()) return status;
      const std::string rig = RigOf(*this_method, request);
      const auto rights = RightsOf(call.caller, Role::kRead);
      if (rights && !rights->labels.empty()) {
        const std::shared_ptr<Message> same(request.New());
        same->CopyFrom(request);
        queue->SetGate([context, call, this_method, same] {
          return Authorised(context, call, *this_method, *same);
        });
      }
      // Registered first: a rig that is deleted meanwhile is not missed.
      std::shared_ptr<void> of_rig;
      if (!rig.empty()) {
        SELFCAL_ASSIGN_OR_RETURN(of_rig, context.watches->Add(rig, queue));
      }
      SELFCAL_ASSIGN_OR_RETURN(auto subscription,
                               handler(call, request, queue));
      return std::make_shared<std::array<std::shared_ptr<void>, 2>>(
          std::array{std::move(of_rig), std::move(subscription)});
    });
  });
  methods_.push_back(std::move(method));
}

void Methods::AddUpload(Method method, UploadHandler handler) {
  method.descriptor = MethodOf(*method.request);
  method.handler = UploadHandler(
      [this_method = method.descriptor,
       empty = method.request,
       context = context_,
       handler = std::move(handler)](
          const Call& call, const ReadRequest& read, Message* response) {
        return Guarded(context, [&] {
          absl::Status status = Authorised(context, call, *this_method, *empty);
          return status.ok() ? handler(call, read, response) : status;
        });
      });
  methods_.push_back(std::move(method));
}

void Methods::AddExchange(Method method, ExchangeHandler handler) {
  method.descriptor = MethodOf(*method.request);
  method.handler =
      ExchangeHandler([this_method = method.descriptor,
                       response = method.response,
                       context = context_,
                       handler = std::move(handler)](
                          const Call& call) -> std::unique_ptr<Exchange> {
        return std::make_unique<AuthorisedExchange>(
            context, call, *this_method, *response, handler(call));
      });
  methods_.push_back(std::move(method));
}

}  // namespace selfcal::server
