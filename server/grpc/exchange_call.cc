#include <condition_variable>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>

#include "server/api/errors.h"
#include "server/grpc/answer_queue.h"
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
    reading_ = ok ? Reading::kArrived : Reading::kClosed;
    changed_.notify_all();
  }

  void OnWriteDone(bool ok) override {
    const grpc::ByteBuffer* next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      answers_.EndWrite();
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
  enum class Reading {
    kIdle,
    kInProgress,
    kArrived,  // a request was read and not yet taken
    kClosed,   // the caller sends no more
  };

  // The request that is read, and the reservation for it.
  struct Incoming {
    grpc::ByteBuffer bytes;
    ReadGate::Admission admission;
    std::int64_t last_bytes = 0;  // size of the last request
  };

  void Run() {
    std::unique_lock lock(mutex_);
    while (!Over()) {
      if (reading_ == Reading::kArrived && !Ending()) {
        reading_ = Reading::kIdle;
        AnswerQueue::Answer* const answer = answers_.Add();
        lock.unlock();
        Take(answer);
        lock.lock();
      } else if (reading_ == Reading::kIdle && !Ending() &&
                 answers_.size() < kReadAhead) {
        lock.unlock();
        auto admitted = context_.reads->Enter(incoming_.last_bytes,
                                              [this] { return !Goes(); });
        lock.lock();
        if (!admitted) continue;
        incoming_.admission = *std::move(admitted);
        reading_ = Reading::kInProgress;
        lock.unlock();
        StartRead(&incoming_.bytes);
        lock.lock();
      } else if (!incoming_.admission.held()) {
        changed_.wait(lock);
      } else if (changed_.wait_for(lock, ReadGate::kLook) ==
                     std::cv_status::timeout &&
                 reading_ != Reading::kArrived) {
        incoming_.admission.Look();
      }
    }
    const grpc::Status status = Failed()       ? ToGrpc(answers_.error())
                                : gone_.load() ? grpc::Status::CANCELLED
                                               : grpc::Status::OK;
    lock.unlock();
    Finish(status);  // may delete this
  }

  // True if every request in progress has an answer and nothing else is left to
  // do. With the lock held, as for all that follow except Take.
  bool Over() const {
    if (answers_.writing()) return false;
    if (Ending()) return answers_.AllFilled();
    return reading_ == Reading::kClosed && answers_.size() == 0;
  }

  bool Failed() const { return !answers_.error().ok(); }
  bool Ending() const { return Failed() || gone_; }

  bool Goes() {
    const std::lock_guard lock(mutex_);
    return !Ending();
  }

  void Take(AnswerQueue::Answer* answer) {
    incoming_.last_bytes = static_cast<std::int64_t>(incoming_.bytes.Length());
    const std::unique_ptr<Message> request(method_.request->New());
    auto work = TakeRequest(
        context_, incoming_.bytes, [this] { return !Goes(); }, request.get());
    incoming_.bytes.Clear();
    incoming_.admission.End();
    if (!work.ok()) return Fill(answer, work.status(), *method_.response);
    answer->work = *std::move(work);
    exchange_->Take(
        *request,
        [this, answer](const absl::Status& status, const Message& response) {
          Fill(answer, status, response);
        });
  }

  // Once the lock is released the call may be over and deleted, unless a write
  // was begun.
  void Fill(AnswerQueue::Answer* answer,
            const absl::Status& status,
            const Message& response) {
    grpc::ByteBuffer bytes;
    if (status.ok()) bytes = Serialise(response);
    const grpc::ByteBuffer* next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      answer->Fill(status, &bytes);
      next = NextToWrite();
      changed_.notify_all();
    }
    if (next != nullptr) StartWrite(next);
  }

  const grpc::ByteBuffer* NextToWrite() {
    return Ending() ? nullptr : answers_.BeginWrite();
  }

  const CallContext context_;
  const Method& method_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected
  const Call call_;
  const std::unique_ptr<Exchange> exchange_;  // of the thread
  Incoming incoming_;  // of the thread; gRPC fills the bytes during a read

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  Reading reading_ = Reading::kIdle;
  AnswerQueue answers_;
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
