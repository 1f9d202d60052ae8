// Two threads: `sender_` connects, sends and waits out the backoff; while a
// connection lasts, a reader takes the acknowledgements. The queue holds, in
// order, first what was sent on this connection and is unacknowledged
// (in_flight_ segments), then what is to be sent.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "client/selfcal/backoff.h"
#include "client/selfcal/client.h"
#include "client/selfcal/connection.h"
#include "client/selfcal/segment_messages.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using Request = v1::StreamSegmentsRequest;
using Response = v1::StreamSegmentsResponse;
using ClientStream = grpc::ClientReaderWriter<Request, Response>;

// Errors that the next connection would give again.
bool EndsStream(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsInvalidArgument(status) ||
         absl::IsPermissionDenied(status) || absl::IsUnauthenticated(status);
}

}  // namespace

class SegmentStream::Impl {
 public:
  Impl(const ClientOptions& options, AckCallback on_ack)
      : options_(options), on_ack_(std::move(on_ack)) {
    try {
      sender_ = std::thread([this] { Run(); });
    } catch (const std::exception& error) {
      end_ = absl::ResourceExhaustedError(error.what());
    }
  }

  ~Impl() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
      if (context_ != nullptr) context_->TryCancel();
    }
    changed_.notify_all();
    if (sender_.joinable()) sender_.join();
  }

  bool Send(MotionSegment segment) {
    {
      std::lock_guard lock(mutex_);
      const auto limit =
          static_cast<std::size_t>(std::max(options_.max_queue, 1));
      if (!end_.ok() || queue_.size() >= limit || !Push(std::move(segment))) {
        ++statistics_.dropped;
        return false;
      }
      ++statistics_.queued;
    }
    changed_.notify_all();
    return true;
  }

  absl::Status Drain(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    // Longer ones may not be representable as a point in time.
    const auto wait = std::min<std::chrono::milliseconds>(
        timeout, std::chrono::hours(24 * 365));
    const bool done = changed_.wait_for(lock, wait, [this] {
      return !end_.ok() || (queue_.empty() && callbacks_due_ == 0);
    });
    if (!end_.ok()) return end_;
    if (done) return absl::OkStatus();
    std::string message =
        std::to_string(queue_.size()) + " segments are not acknowledged";
    if (!connection_.ok()) message += ": " + connection_.ToString();
    return absl::DeadlineExceededError(message);
  }

  StreamStatistics statistics() const {
    std::lock_guard lock(mutex_);
    return statistics_;
  }

  absl::Status connection_status() const {
    std::lock_guard lock(mutex_);
    return connection_;
  }

 private:
  struct Entry {
    std::shared_ptr<const MotionSegment> segment;
    bool was_sent = false;
  };

  bool Push(MotionSegment segment) {
    try {
      queue_.push_back(
          {std::make_shared<const MotionSegment>(std::move(segment))});
      return true;
    } catch (const std::exception&) {  // no memory
      return false;
    }
  }

  void Run() {
    Backoff backoff(
        options_.min_backoff, options_.max_backoff, JitterSeed(this));
    while (WaitForWork()) {
      const absl::Status status = TryConverse();
      if (answered_) backoff.Reset();
      if (!AfterConversation(status, backoff.Next())) return;
    }
  }

  bool WaitForWork() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_ || !queue_.empty(); });
    return !stop_;
  }

  // False if there is to be no other conversation.
  bool AfterConversation(const absl::Status& status,
                         std::chrono::milliseconds wait) {
    std::unique_lock lock(mutex_);
    if (stop_) return false;
    connection_ = status;
    if (EndsStream(status)) {
      end_ = status;
      lock.unlock();
      changed_.notify_all();
      return false;
    }
    changed_.wait_for(lock, wait, [this] { return stop_; });
    return !stop_;
  }

  absl::Status TryConverse() {
    absl::Status status;
    try {
      status = Converse();
    } catch (const std::exception& error) {  // no memory, no thread
      status = absl::InternalError(error.what());
    }
    std::lock_guard lock(mutex_);
    context_ = nullptr;
    return status;
  }

  // One connection, from its beginning to its end, which is never a success.
  absl::Status Converse() {
    const auto stub = v1::SegmentService::NewStub(MakeChannel(options_.target));
    const auto context = std::make_shared<grpc::ClientContext>();
    {
      std::lock_guard lock(mutex_);
      if (stop_) return absl::CancelledError();
      context_ = context;
      in_flight_ = 0;
      broken_ = absl::OkStatus();
      answered_ = false;
      reading_ = true;
    }
    const auto stream = stub->StreamSegments(context.get());
    std::thread reader([this, &stream] { ReadAll(stream.get()); });
    WriteAll(stream.get());
    reader.join();
    const absl::Status status = ToAbsl(stream->Finish());
    if (!broken_.ok()) return broken_;
    if (!status.ok()) return status;
    return absl::UnavailableError("the daemon ended the stream");
  }

  // Sends until the connection ends.
  void WriteAll(ClientStream* stream) {
    try {
      while (const auto segment = NextToSend()) {
        Request request;
        auto violations = MakeRequest(options_.rig, *segment, &request);
        if (!violations.empty()) {
          Acknowledge({segment->key,
                       Acknowledgement::Verdict::kRejected,
                       std::move(violations)});
        } else if (!stream->Write(request)) {
          return;  // the reader learns of it, too
        }
      }
    } catch (const std::exception& error) {
      Break(absl::InternalError(error.what()));
    }
  }

  // Waits until there is one and the window has room; null at the end.
  std::shared_ptr<const MotionSegment> NextToSend() {
    std::unique_lock lock(mutex_);
    const auto window =
        static_cast<std::size_t>(std::max(options_.max_unacknowledged, 1));
    changed_.wait(lock, [&] {
      return stop_ || !reading_ || in_flight_ < std::min(window, queue_.size());
    });
    if (stop_ || !reading_) return nullptr;
    Entry& entry = queue_[in_flight_];
    ++in_flight_;  // before it is sent, for its acknowledgement may be quick
    if (entry.was_sent) ++statistics_.resent;
    entry.was_sent = true;
    return entry.segment;
  }

  // Takes acknowledgements until the connection ends.
  void ReadAll(ClientStream* stream) {
    try {
      Response response;
      while (stream->Read(&response)) {
        NoteAnswer();
        if (!Acknowledge(ToAcknowledgement(response))) {
          Break(absl::InternalError(
              "the daemon acknowledged a segment that it was not sent"));
        }
      }
    } catch (const std::exception& error) {
      Break(absl::InternalError(error.what()));
    }
    {
      std::lock_guard lock(mutex_);
      reading_ = false;
    }
    changed_.notify_all();
  }

  void NoteAnswer() {
    std::lock_guard lock(mutex_);
    if (!answered_) ++statistics_.connections;
    answered_ = true;
    connection_ = absl::OkStatus();
  }

  // Ends the connection from this side.
  void Break(const absl::Status& why) {
    std::lock_guard lock(mutex_);
    if (broken_.ok()) broken_ = why;
    context_->TryCancel();
  }

  // Takes the segment off the queue and calls back. False if it is not among
  // those that were sent.
  bool Acknowledge(const Acknowledgement& ack) {
    {
      std::lock_guard lock(mutex_);
      const auto end = queue_.begin() + static_cast<std::ptrdiff_t>(in_flight_);
      const auto entry =
          std::find_if(queue_.begin(), end, [&](const Entry& candidate) {
            return candidate.segment->key == ack.key;
          });
      if (entry == end) return false;
      queue_.erase(entry);
      --in_flight_;
      Count(ack.verdict);
      ++callbacks_due_;
    }
    CallBack(ack);
    {
      std::lock_guard lock(mutex_);
      --callbacks_due_;
    }
    changed_.notify_all();
    return true;
  }

  void Count(Acknowledgement::Verdict verdict) {
    switch (verdict) {
      case Acknowledgement::Verdict::kStored:
        ++statistics_.stored;
        break;
      case Acknowledgement::Verdict::kDuplicate:
        ++statistics_.duplicates;
        break;
      case Acknowledgement::Verdict::kRejected:
        ++statistics_.rejected;
        break;
    }
  }

  void CallBack(const Acknowledgement& ack) {
    if (!on_ack_) return;
    std::lock_guard one_at_a_time(callback_mutex_);
    try {
      on_ack_(ack);
    } catch (...) {
      std::lock_guard lock(mutex_);
      ++statistics_.callback_failures;
    }
  }

  const ClientOptions options_;
  const AckCallback on_ack_;
  std::mutex callback_mutex_;  // taken before mutex_

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::deque<Entry> queue_;
  std::size_t in_flight_ = 0;
  int callbacks_due_ = 0;
  StreamStatistics statistics_;
  absl::Status connection_;
  absl::Status end_;       // not OK: the stream has ended for good
  absl::Status broken_;    // not OK: why this side ended the connection
  bool reading_ = false;   // the connection lasts
  bool answered_ = false;  // the daemon has said something on it
  bool stop_ = false;
  std::shared_ptr<grpc::ClientContext> context_;  // while there is one

  std::thread sender_;  // last: it uses all of the above
};

SegmentStream::SegmentStream(const ClientOptions& options, AckCallback on_ack)
    : impl_(std::make_unique<Impl>(options, std::move(on_ack))) {}
SegmentStream::~SegmentStream() = default;

bool SegmentStream::Send(MotionSegment segment) {
  return impl_->Send(std::move(segment));
}

absl::Status SegmentStream::Drain(std::chrono::milliseconds timeout) {
  return impl_->Drain(timeout);
}

StreamStatistics SegmentStream::statistics() const {
  return impl_->statistics();
}

absl::Status SegmentStream::connection_status() const {
  return impl_->connection_status();
}

}  // namespace selfcal::client
