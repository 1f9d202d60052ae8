#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <variant>

#include "server/api/errors.h"
#include "server/grpc/bytes.h"
#include "server/grpc/caller.h"
#include "server/grpc/calls.h"
#include "server/grpc/status.h"
#include "server/grpc/take_request.h"

namespace selfcal::server {
namespace {

class UploadCall final : public grpc::ServerReadReactor<grpc::ByteBuffer> {
 public:
  UploadCall(const CallContext& context,
             const Method& method,
             const Rpc& rpc,
             grpc::ByteBuffer* response)
      : context_(context),
        method_(method),
        call_{CallerOf(rpc, context.local_role),
              [this] { return gone_.load(); }},
        response_(response) {}

  void Run() {
    const std::unique_ptr<Message> response(method_.response->New());
    absl::Status status = std::get<UploadHandler>(method_.handler)(
        call_,
        [this](Message* request) { return Read(request); },
        response.get());
    if (!malformed_.ok()) status = malformed_;
    if (status.ok()) *response_ = Serialise(*response);
    Finish(ToGrpc(status));  // may delete this
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    read_ = ok;
    done_.notify_one();
  }
  void OnCancel() override { gone_ = true; }
  void OnDone() override { delete this; }

 private:
  // Waits for a request; false if there are no more.
  bool Read(Message* request) {
    StartRead(&bytes_);
    std::unique_lock lock(mutex_);
    done_.wait(lock, [this] { return read_.has_value(); });
    if (!*std::exchange(read_, std::nullopt)) return false;
    work_.Shrink(0);
    auto work = TakeRequest(
        context_, bytes_, [this] { return gone_.load(); }, request);
    malformed_ = work.status();
    if (work.ok()) work_ = *std::move(work);
    return malformed_.ok();
  }

  const CallContext context_;
  const Method& method_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  const Call call_;
  grpc::ByteBuffer* const response_;
  grpc::ByteBuffer bytes_;  // being read
  MemoryPool::Share work_;  // of the last request
  absl::Status malformed_;
  std::mutex mutex_;
  std::condition_variable done_;
  std::optional<bool> read_;  // guarded by mutex_
};

}  // namespace

grpc::ServerReadReactor<grpc::ByteBuffer>* StartUpload(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    grpc::ByteBuffer* response) {
  auto* call = new UploadCall(context, method, *rpc, response);
  if (!context.threads->Run([call] { call->Run(); })) {
    call->Finish(ToGrpc(TooManyCalls()));
  }
  return call;
}

}  // namespace selfcal::server
