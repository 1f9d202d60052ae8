#include "server/service/segment_call.h"

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/segment_stream.h"

namespace selfcal::server {
namespace {

// The call's own thread reads, hands segments to the stream, and ends the call.
// Answers arrive on any thread, which starts to write the first of them. gRPC
// operations are started with the lock released, because they may run another
// callback of this class before they return; the guarded members state which
// operation is in progress.
class SegmentCall final : public SegmentReactor {
 public:
  SegmentCall(const ServiceContext& context,
              const grpc::CallbackServerContext& call,
              std::atomic<int>* open_calls)
      : stream_(context, [this] { return gone_.load(); }),
        call_(call),
        local_role_(context.local_role),
        open_calls_(open_calls) {
    std::thread([this] { Run(); }).detach();
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    (ok ? arrived_ : closed_) = true;
    changed_.notify_all();
  }

  void OnWriteDone(bool ok) override {
    const v1::StreamSegmentsResponse* next = nullptr;
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
    --*open_calls_;
    delete this;
  }

 private:
  struct Slot {
    bool filled = false;
    SegmentStream::Answer answer;
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
        reading_ = true;
        lock.unlock();
        StartRead(&request_);
        lock.lock();
      } else {
        changed_.wait(lock);
      }
    }
    const grpc::Status status = failed_        ? failure_
                                : gone_.load() ? grpc::Status::CANCELLED
                                               : grpc::Status::OK;
    lock.unlock();
    Finish(status);  // may delete this
  }

  // True if every segment has an answer and nothing remains to be done. This
  // and the functions below, except Take, need the lock.
  bool Over() const {
    if (writing_ || (arrived_ && !Ending())) return false;
    for (const auto& slot : answers_) {
      if (!slot->filled || !Ending()) return false;
    }
    return Ending() || closed_;
  }

  bool Ending() const { return failed_ || gone_; }

  void Take(Slot* slot) {
    const grpc::Status refused = Guarded([&] {
      const grpc::Status may = Authorise(call_, local_role_, request_);
      if (!may.ok()) return may;
      stream_.Take(request_, [this, slot](SegmentStream::Answer answer) {
        Fill(slot, std::move(answer));
      });
      return grpc::Status::OK;
    });
    if (!refused.ok()) Fill(slot, {refused, {}});
  }

  // Once the lock is released, the call may have ended and this may be deleted,
  // unless a write is in progress.
  void Fill(Slot* slot, SegmentStream::Answer answer) {
    const v1::StreamSegmentsResponse* next = nullptr;
    {
      const std::lock_guard lock(mutex_);
      slot->answer = std::move(answer);
      slot->filled = true;
      next = NextToWrite();
      changed_.notify_all();
    }
    if (next != nullptr) StartWrite(next);
  }

  const v1::StreamSegmentsResponse* NextToWrite() {
    if (writing_ || Ending() || answers_.empty()) return nullptr;
    const Slot& first = *answers_.front();
    if (!first.filled) return nullptr;
    if (!first.answer.status.ok()) {
      failed_ = true;
      failure_ = first.answer.status;
      return nullptr;
    }
    writing_ = true;
    return &first.answer.response;
  }

  SegmentStream stream_;                     // used by the thread
  const grpc::CallbackServerContext& call_;  // outlives it
  const Role local_role_;
  v1::StreamSegmentsRequest request_;
  std::atomic<int>* const open_calls_;
  std::atomic<bool> gone_ = false;  // the caller has disconnected

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<std::unique_ptr<Slot>> answers_;  // in the order of the segments
  bool reading_ = false;
  bool arrived_ = false;  // a request was read and is not processed yet
  bool closed_ = false;   // the caller sends no more requests
  bool writing_ = false;
  bool failed_ = false;  // the call ends with `failure_`
  grpc::Status failure_;
};

class Refusal final : public SegmentReactor {
 public:
  explicit Refusal(const grpc::Status& status) { Finish(status); }
  void OnDone() override { delete this; }
};

}  // namespace

SegmentReactor* StartSegmentCall(const ServiceContext& context,
                                 const grpc::CallbackServerContext* call,
                                 std::atomic<int>* open_calls) {
  if (++*open_calls <= context.max_segment_streams) {
    try {
      return new SegmentCall(context, *call, open_calls);
    } catch (const std::system_error&) {
      // No thread could be started: refuse the call, as beyond the limit.
    }
  }
  --*open_calls;
  return new Refusal(
      ToGrpc(absl::ResourceExhaustedError(
                 "too many streams are open: close one, or try again later"),
             {}));
}

}  // namespace selfcal::server
