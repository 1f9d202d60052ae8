#include <chrono>
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

class StreamingCall final : public grpc::ServerWriteReactor<grpc::ByteBuffer> {
 public:
  StreamingCall(const CallContext& context,
                const Method& method,
                Rpc* rpc,
                const grpc::ByteBuffer& request)
      : context_(context),
        method_(method),
        rpc_(rpc),
        call_{CallerOf(*rpc, context.local_role),
              [this] { return gone_.load(); }},
        request_(request) {}

  void Run() {
    const std::unique_ptr<Message> request(method_.request->New());
    const auto work = TakeRequest(
        context_, request_, [this] { return gone_.load(); }, request.get());
    absl::Status status = work.status();
    if (status.ok()) {
      status = std::get<StreamingHandler>(method_.handler)(
          call_, *request, [this](const Message& response) {
            return Write(response);
          });
    }
    Finish(ToGrpc(status));  // may delete this
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    written_ = ok;
    done_.notify_one();
  }
  void OnCancel() override { gone_ = true; }
  void OnDone() override { delete this; }

 private:
  // Waits until the response is sent; false if the caller has disconnected or
  // does not read.
  bool Write(const Message& response) {
    if (gone_) return false;
    bytes_ = Serialise(response);
    StartWrite(&bytes_);
    std::unique_lock lock(mutex_);
    const auto is_written = [this] { return written_.has_value(); };
    if (!done_.wait_for(lock, context_.max_write_time, is_written)) {
      gone_ = true;
      rpc_->TryCancel();  // ends the write
      done_.wait(lock, is_written);
    }
    return *std::exchange(written_, std::nullopt);
  }

  const CallContext context_;
  const Method& method_;
  Rpc* const rpc_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  const Call call_;
  const grpc::ByteBuffer request_;
  grpc::ByteBuffer bytes_;  // being written
  std::mutex mutex_;
  std::condition_variable done_;
  std::optional<bool> written_;  // guarded by mutex_
};

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* StartStreaming(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    const grpc::ByteBuffer* request) {
  auto* call = new StreamingCall(context, method, rpc, *request);
  if (!context.threads->Run([call] { call->Run(); })) {
    call->Finish(ToGrpc(TooManyCalls()));
  }
  return call;
}

}  // namespace selfcal::server
