#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>

#include "server/api/errors.h"
#include "server/grpc/bytes.h"
#include "server/grpc/caller.h"
#include "server/grpc/calls.h"
#include "server/grpc/status.h"
#include "server/grpc/take_request.h"

namespace selfcal::server {
namespace {

using Reactor = grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>;

// The call's own thread reads, hands requests to the exchange, and ends the
// call. Responses arrive on any thread, which starts to write the first of
// them. gRPC operations are started with the lock released, because they may
// run another callback of this class before they return; the guarded members
// state which operation is in progress.
class ExchangeCall final : public Reactor {
 public:
  ExchangeCall(const CallContext& context, const Method& method, const Rpc& rpc)
      : context_(context),
        method_(method),
        call_{CallerOf(rpc, context.local_role),
              [this] { return gone_.load(); }},
        exchange_(std::get<ExchangeHandler>(method.handler)(call_)) {
    std::thread([this] { Run(); }).detach();
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    (ok ? arrived_ : closed_) = true;
    changed_.notify_all();
  }

  void OnWriteDone(bool ok) override {
    const grpc::ByteBuffer* next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      answers_.pop_front();
      if (!ok) gone_ = true;
      next = NextToWrite();
      changed_.notify_all();
    }
    if (next != nullptr) StartWrite(next);
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    gone_ = true;
    changed_.notify_all();
  }

  void OnDone() override {
    --*context_.exchanges;
    delete this;
  }

 private:
  struct Slot {
    bool filled = false;
    MemoryPool::Share work;  // until it is filled
    absl::Status status;
    grpc::ByteBuffer response;
  };

  void Run() {
    std::unique_lock lock(mutex_);
    while (!Over()) {
      if (arrived_ && !Ending()) {
        arrived_ = false;
        Slot* slot = answers_.emplace_back(std::make_unique<Slot>()).get();
        lock.unlock();
        Take(slot);
        lock.lock();
      } else if (!reading_ && !closed_ && !Ending() &&
                 answers_.size() < kReadAhead) {
        lock.unlock();
        auto admitted =
            context_.reads->Enter(last_bytes_, [this] { return !Goes(); });
        lock.lock();
        if (!admitted) continue;
        admitted_ = *std::move(admitted);
        reading_ = true;
        lock.unlock();
        StartRead(&bytes_);
        lock.lock();
      } else if (!admitted_.held()) {
        changed_.wait(lock);
      } else if (changed_.wait_for(lock, ReadGate::kLook) ==
                     std::cv_status::timeout &&
                 !arrived_) {
        admitted_.Look();
      }
    }
    const grpc::Status status = failed_        ? ToGrpc(failure_)
                                : gone_.load() ? grpc::Status::CANCELLED
                                               : grpc::Status::OK;
    lock.unlock();
    Finish(status);  // may delete this
  }

  // True if every request in progress has an answer and nothing else is left to
  // do. With the lock held, as for all that follow except Take.
  bool Over() const {
    if (writing_ || (arrived_ && !Ending())) return false;
    for (const auto& slot : answers_) {
      if (!slot->filled || !Ending()) return false;
    }
    return Ending() || closed_;
  }

  bool Ending() const { return failed_ || gone_; }

  bool Goes() {
    const std::lock_guard lock(mutex_);
    return !Ending();
  }

  void Take(Slot* slot) {
    last_bytes_ = static_cast<std::int64_t>(bytes_.Length());
    const std::unique_ptr<Message> request(method_.request->New());
    auto work = TakeRequest(
        context_, bytes_, [this] { return !Goes(); }, request.get());
    bytes_.Clear();
    admitted_.End();
    if (!work.ok()) return Fill(slot, work.status(), *method_.response);
    slot->work = *std::move(work);
    exchange_->Take(
        *request,
        [this, slot](const absl::Status& status, const Message& response) {
          Fill(slot, status, response);
        });
  }

  // Once the lock is released the call may be over and deleted, unless a write
  // was begun.
  void Fill(Slot* slot, const absl::Status& status, const Message& response) {
    grpc::ByteBuffer bytes;
    if (status.ok()) bytes = Serialise(response);
    const grpc::ByteBuffer* next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      slot->status = status;
      slot->response.Swap(&bytes);
      slot->filled = true;
      slot->work.Shrink(0);
      next = NextToWrite();
      changed_.notify_all();
    }
    if (next != nullptr) StartWrite(next);
  }

  const grpc::ByteBuffer* NextToWrite() {
    if (writing_ || Ending() || answers_.empty()) return nullptr;
    const Slot& first = *answers_.front();
    if (!first.filled) return nullptr;
    if (!first.status.ok()) {
      failed_ = true;
      failure_ = first.status;
      return nullptr;
    }
    writing_ = true;
    return &first.response;
  }

  const CallContext context_;
  const Method& method_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  const Call call_;
  const std::unique_ptr<Exchange> exchange_;  // of the thread
  grpc::ByteBuffer bytes_;                    // being read
  ReadGate::Admission admitted_;              // for it; of the thread
  std::int64_t last_bytes_ = 0;  // of the last request; of the thread

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<std::unique_ptr<Slot>> answers_;  // in the order of the requests
  bool reading_ = false;
  bool arrived_ = false;  // a request was read and not yet taken
  bool closed_ = false;   // the caller sends no more
  bool writing_ = false;
  bool failed_ = false;  // ends with `failure_`
  absl::Status failure_;
};

class Refusal final : public Reactor {
 public:
  explicit Refusal(const grpc::Status& status) { Finish(status); }
  void OnDone() override { delete this; }
};

}  // namespace

Reactor* StartExchange(const CallContext& context,
                       const Method& method,
                       Rpc* rpc) {
  if (++*context.exchanges <= context.max_exchanges) {
    try {
      return new ExchangeCall(context, method, *rpc);
    } catch (const std::system_error&) {
      // No thread: refused as one too many.
    }
  }
  --*context.exchanges;
  return new Refusal(ToGrpc(ForClient(absl::ResourceExhaustedError(
      "too many streams are open: close one, or try again later"))));
}

}  // namespace selfcal::server
