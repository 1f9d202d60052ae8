#include <memory>
#include <variant>

#include "server/api/errors.h"
#include "server/grpc/bytes.h"
#include "server/grpc/caller.h"
#include "server/grpc/calls.h"
#include "server/grpc/status.h"
#include "server/grpc/take_request.h"

namespace selfcal::server {
namespace {

class UnaryCall final : public grpc::ServerUnaryReactor {
 public:
  UnaryCall(const CallContext& context,
            const Method& method,
            const Rpc& rpc,
            const grpc::ByteBuffer& request,
            grpc::ByteBuffer* response)
      : context_(context),
        method_(method),
        call_{CallerOf(rpc, context.local_role),
              [this] { return gone_.load(); }},
        request_(request),
        response_(response) {}

  void Run() {
    const std::unique_ptr<Message> request(method_.request->New());
    const std::unique_ptr<Message> response(method_.response->New());
    const auto work = TakeRequest(
        context_,
        request_,
        [this] { return gone_.load(); },
        request.get(),
        method_.work);
    absl::Status status = work.status();
    request_.Clear();
    if (status.ok()) {
      status = std::get<UnaryHandler>(method_.handler)(
          call_, *request, response.get());
    }
    if (status.ok()) *response_ = Serialise(*response);
    Finish(ToGrpc(status));  // may delete this
  }

  void OnCancel() override { gone_ = true; }
  void OnDone() override { delete this; }

 private:
  const CallContext context_;
  const Method& method_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  const Call call_;
  grpc::ByteBuffer request_;
  grpc::ByteBuffer* const response_;
};

}  // namespace

grpc::ServerUnaryReactor* StartUnary(const CallContext& context,
                                     const Method& method,
                                     Rpc* rpc,
                                     const grpc::ByteBuffer* request,
                                     grpc::ByteBuffer* response) {
  auto* call = new UnaryCall(context, method, *rpc, *request, response);
  if (!context.threads->Run([call] { call->Run(); })) {
    call->Finish(ToGrpc(TooManyCalls()));
  }
  return call;
}

absl::Status TooManyCalls() {
  return ForClient(absl::ResourceExhaustedError(
      "too many calls are being answered: try again in a moment"));
}

}  // namespace selfcal::server
