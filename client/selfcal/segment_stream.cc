// A stream has three threads: `keeper_` encodes segments and uses the disk;
// `sender_` connects, sends and waits for the backoff; while a connection
// lasts, a reader receives the acknowledgements.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "client/selfcal/backoff.h"
#include "client/selfcal/client.h"
#include "client/selfcal/connection.h"
#include "client/selfcal/keeper_thread.h"
#include "client/selfcal/segment_messages.h"
#include "client/selfcal/segment_queue.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using Request = v1::StreamSegmentsRequest;
using Response = v1::StreamSegmentsResponse;
using ClientStream = grpc::ClientReaderWriter<Request, Response>;

// True for errors that the next connection would return again.
bool EndsStream(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsInvalidArgument(status) ||
         absl::IsPermissionDenied(status) || absl::IsUnauthenticated(status);
}

// Has no message, because a message needs memory.
absl::Status NoMemory() {
  return absl::Status(absl::StatusCode::kResourceExhausted, "");
}

}  // namespace

class SegmentStream::Impl {
 public:
  // Throws std::bad_alloc, and std::system_error if no thread can be started.
  Impl(const ClientOptions& options, AckCallback on_ack)
      : options_(options),
        on_ack_(std::move(on_ack)),
        queue_(options_),
        keeper_(options_,
                &queue_,
                [this](const Acknowledgement& ack) { CallBack(ack); }),
        sender_([this] { Run(); }) {}

  ~Impl() {
    queue_.Stop();
    {
      std::lock_guard lock(mutex_);
      if (context_ != nullptr) context_->TryCancel();
    }
    sender_.join();
  }

  SegmentQueue& queue() { return queue_; }

  absl::Status Drain(std::chrono::milliseconds timeout) {
    // The end of a longer timeout may not be representable as a point in time.
    const auto wait = std::min<std::chrono::milliseconds>(
        timeout, std::chrono::hours(24 * 365));
    const bool done = queue_.WaitUntilDone(wait);
    const absl::Status end = queue_.end();
    if (!end.ok()) return end;
    if (done) return absl::OkStatus();
    const std::size_t waiting = queue_.unacknowledged();
    std::string message = std::to_string(waiting) +
                          (waiting == 1 ? " segment is" : " segments are") +
                          " not acknowledged";
    const absl::Status connection = connection_status();
    if (!connection.ok()) message += ": " + connection.ToString();
    return absl::DeadlineExceededError(message);
  }

  absl::Status connection_status() const {
    std::lock_guard lock(mutex_);
    return connection_;
  }

 private:
  void Run() {
    Backoff backoff(
        options_.min_backoff, options_.max_backoff, JitterSeed(this));
    while (queue_.WaitForWork()) {
      const absl::Status status = TryConnection();
      if (answered_) backoff.Reset();
      if (!PrepareReconnection(status, backoff.Next())) return;
    }
  }

  // Returns false if the stream must not connect again.
  bool PrepareReconnection(const absl::Status& status,
                           std::chrono::milliseconds wait) {
    if (queue_.stopped()) return false;
    {
      std::lock_guard lock(mutex_);
      connection_ = status;
    }
    if (EndsStream(status)) {
      queue_.End(status);
      return false;
    }
    return queue_.Pause(wait);
  }

  absl::Status TryConnection() {
    absl::Status status;
    try {
      status = RunConnection();
    } catch (const std::exception& error) {  // out of memory or threads
      status = absl::InternalError(error.what());
    }
    std::lock_guard lock(mutex_);
    context_ = nullptr;
    return status;
  }

  // Handles one connection until it ends; never returns OK.
  absl::Status RunConnection() {
    answered_ = false;
    const auto channel = MakeChannel(options_);
    if (!channel.ok()) return channel.status();
    const auto stub = v1::SegmentService::NewStub(*channel);
    const auto context = std::make_shared<grpc::ClientContext>();
    {
      std::lock_guard lock(mutex_);
      context_ = context;
      broken_ = absl::OkStatus();
    }
    // Stopping sets the flag and then looks for a context; this sets the
    // context and then looks at the flag, so that one of them sees the other.
    if (queue_.stopped()) return absl::CancelledError();
    queue_.Open();
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
    while (const auto request = queue_.Next()) {
      if (!stream->Write(*request)) return;  // the reader notices it, too
    }
  }

  // Receives acknowledgements until the connection ends.
  void ReadAll(ClientStream* stream) {
    try {
      Response response;
      while (stream->Read(&response)) {
        NoteAnswer();
        const Acknowledgement ack = ToAcknowledgement(response);
        if (queue_.Acknowledge(ack)) {
          CallBack(ack);
        } else {
          Break(absl::InternalError(
              "the daemon acknowledged a segment that it was not sent"));
        }
      }
    } catch (const std::exception& error) {
      Break(absl::InternalError(error.what()));
    }
    queue_.Close();
  }

  void NoteAnswer() {
    if (!answered_) queue_.NoteConnection();
    answered_ = true;
    std::lock_guard lock(mutex_);
    connection_ = absl::OkStatus();
  }

  // Ends the connection from this side.
  void Break(const absl::Status& why) {
    std::lock_guard lock(mutex_);
    if (broken_.ok()) broken_ = why;
    context_->TryCancel();
  }

  void CallBack(const Acknowledgement& ack) {
    bool failed = false;
    if (on_ack_) {
      std::lock_guard one_at_a_time(callback_mutex_);
      try {
        on_ack_(ack);
      } catch (...) {
        failed = true;
      }
    }
    queue_.CallbackReturned(failed);
  }

  const ClientOptions options_;
  const AckCallback on_ack_;
  std::mutex callback_mutex_;

  mutable std::mutex mutex_;  // guards the three below
  absl::Status connection_;
  absl::Status broken_;  // if not OK, why the client ended the connection
  std::shared_ptr<grpc::ClientContext> context_;  // while there is one

  // True if the daemon has answered on the connection. The reader writes it;
  // the sender reads it when the reader has ended.
  bool answered_ = false;

  SegmentQueue queue_;
  KeeperThread keeper_;  // it uses all of the above
  std::thread sender_;   // last: it uses all of the above
};

SegmentStream::SegmentStream(const ClientOptions& options,
                             AckCallback on_ack) noexcept {
  try {
    impl_ = std::make_unique<Impl>(options, std::move(on_ack));
  } catch (...) {
    impl_ = nullptr;  // as documented: sends nothing
  }
}
SegmentStream::~SegmentStream() = default;

bool SegmentStream::Send(MotionSegment segment) noexcept {
  return impl_ != nullptr && impl_->queue().Push(std::move(segment));
}

bool SegmentStream::Send(ClosedSegment segment) noexcept {
  return impl_ != nullptr && impl_->queue().Push(std::move(segment));
}

absl::Status SegmentStream::Drain(std::chrono::milliseconds timeout) noexcept {
  if (impl_ == nullptr) return NoMemory();
  try {
    return impl_->Drain(timeout);
  } catch (...) {
    return NoMemory();
  }
}

StreamStatistics SegmentStream::statistics() const noexcept {
  return impl_ == nullptr ? StreamStatistics{} : impl_->queue().statistics();
}

absl::Status SegmentStream::connection_status() const noexcept {
  return impl_ == nullptr ? NoMemory() : impl_->connection_status();
}

absl::Status SegmentStream::spool_status() const noexcept {
  return impl_ == nullptr ? NoMemory() : impl_->queue().spool_status();
}

}  // namespace selfcal::client
