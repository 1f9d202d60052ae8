#include <memory>
#include <mutex>
#include <utility>
#include <variant>

#include "server/api/errors.h"
#include "server/grpc/bytes.h"
#include "server/grpc/caller.h"
#include "server/grpc/calls.h"
#include "server/grpc/status.h"
#include "server/grpc/take_request.h"
#include "server/grpc/watch_sender.h"

namespace selfcal::server {
namespace {

class WatchCall final : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                        public SentWatch,
                        public std::enable_shared_from_this<WatchCall> {
 public:
  WatchCall(const CallContext& context,
            const Method& method,
            const Rpc& rpc,
            const grpc::ByteBuffer& request)
      : context_(context),
        method_(method),
        call_{CallerOf(rpc, context.local_role)},
        request_(request) {}

  // Subscribes, which may block.
  void Start() {
    const std::unique_ptr<Message> request(method_.request->New());
    absl::Status status =
        TakeRequest(
            context_, request_, [this] { return gone_.load(); }, request.get())
            .status();
    if (status.ok()) status = Subscribe(*request);
    if (!status.ok()) return End(status);
    Schedule();
  }

  // gRPC holds the call until OnDone.
  void Hold() { self_ = shared_from_this(); }

  void End(const absl::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;
      ended_ = true;
    }
    Finish(ToGrpc(status));
  }

  void Send() override {
    {
      const std::lock_guard lock(mutex_);
      if (writing_ || ended_) return;
    }
    if (gone_) return End(absl::CancelledError("the caller has disconnected"));
    if (context_.api->stopping()) return End(ShuttingDown());
    std::shared_ptr<const WatchUpdate> update;
    while (update == nullptr) {
      WatchQueue::Taken taken = queue_->Take();
      if (taken.update == nullptr) {
        if (taken.ended) End(taken.status);
        return;
      }
      auto encoded = Encoded(taken.update);
      if (!encoded.ok()) return End(ForClient(encoded.status()));
      update = *std::move(encoded);
    }
    bytes_ = Serialise(std::move(update));
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;
      writing_ = true;
    }
    StartWrite(&bytes_);
  }

  void OnWriteDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
    }
    if (!ok) gone_ = true;
    Schedule();
  }

  void OnCancel() override {
    gone_ = true;
    Schedule();
  }

  void OnDone() override {
    const std::shared_ptr<WatchCall> self = std::move(self_);
    context_.watches->Remove(self);
    std::shared_ptr<void> subscription;
    {
      const std::lock_guard lock(mutex_);
      done_ = true;
      subscription = std::move(subscription_);
    }
  }

 private:
  static absl::StatusOr<std::shared_ptr<const WatchUpdate>> Encoded(
      const WatchQueue::Encode& encode) {
    try {
      return encode();
    } catch (const std::exception& error) {
      return absl::InternalError(error.what());
    }
  }

  absl::Status Subscribe(const Message& request) {
    if (!context_.watches->Add(shared_from_this())) {
      return ForClient(absl::ResourceExhaustedError(
          "too many watches are open: close one, or try again later"));
    }
    queue_ = std::make_shared<WatchQueue>([weak = weak_from_this()] {
      if (const auto self = weak.lock()) self->Schedule();
    });
    auto subscription =
        std::get<WatchHandler>(method_.handler)(call_, request, queue_);
    if (!subscription.ok()) return subscription.status();
    const std::lock_guard lock(mutex_);
    if (!done_) subscription_ = *std::move(subscription);
    return absl::OkStatus();
  }

  void Schedule() { context_.watches->Schedule(shared_from_this()); }

  const CallContext context_;
  const Method& method_;
  const Call call_;
  const grpc::ByteBuffer request_;
  std::shared_ptr<WatchCall> self_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  std::shared_ptr<WatchQueue> queue_;
  grpc::ByteBuffer bytes_;  // being written

  std::mutex mutex_;  // guards what follows
  std::shared_ptr<void> subscription_;
  bool writing_ = false;
  bool ended_ = false;  // Finish was called
  bool done_ = false;   // OnDone was called
};

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* StartWatch(
    const CallContext& context,
    const Method& method,
    Rpc* rpc,
    const grpc::ByteBuffer* request) {
  const auto call =
      std::make_shared<WatchCall>(context, method, *rpc, *request);
  call->Hold();
  // Many may be opened at once, e.g. after a restart of the daemon.
  context.threads->RunSoon([call] { call->Start(); });
  return call.get();
}

}  // namespace selfcal::server
