#include "server/console/computed_stream.h"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "server/api/errors.h"
#include "server/console/json.h"
#include "server/http/error_response.h"

namespace selfcal::server {
namespace {

// Responses that wait for the reader; then the method waits.
constexpr std::size_t kMaxWaiting = 16;

class ComputedStream final : public HttpStream {
 public:
  ComputedStream(const Method& method,
                 const Caller& caller,
                 const Message& request)
      : method_(method),
        call_{caller, [this] { return closed(); }},
        request_(request.New()) {
    request_->CopyFrom(request);
    thread_ = std::thread([this] { Compute(); });
  }

  ~ComputedStream() override {
    Close();
    thread_.join();
  }

  // Waits for the first response; the error if the method fails before it.
  absl::Status Begin() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ || !events_.empty(); });
    return events_.empty() ? status_ : absl::OkStatus();
  }

  std::optional<std::string> Take(std::chrono::milliseconds timeout) override {
    std::unique_lock lock(mutex_);
    changed_.wait_for(
        lock, timeout, [this] { return ended_ || !events_.empty(); });
    if (events_.empty()) {
      if (!ended_) return "";
      const absl::Status status = std::exchange(status_, absl::OkStatus());
      if (status.ok()) return std::nullopt;
      return ErrorEvent(status);
    }
    std::string event = std::move(events_.front());
    events_.pop_front();
    changed_.notify_all();
    return event;
  }

  void Close() override {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  bool closed() {
    const std::lock_guard lock(mutex_);
    return closed_;
  }

  void Compute() {
    absl::Status status = std::get<StreamingHandler>(method_.handler)(
        call_, *request_, [this](const Message& response) {
          return Put(MessageEvent(response));
        });
    const std::lock_guard lock(mutex_);
    ended_ = true;
    status_ = std::move(status);
    changed_.notify_all();
  }

  bool Put(std::string event) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock,
                  [this] { return closed_ || events_.size() < kMaxWaiting; });
    if (closed_) return false;
    events_.push_back(std::move(event));
    changed_.notify_all();
    return true;
  }

  const Method& method_;
  const Call call_;
  const std::unique_ptr<Message> request_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<std::string> events_;
  bool closed_ = false;  // by the reader
  bool ended_ = false;
  absl::Status status_;  // of the method that has ended
  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<HttpStream>> OpenComputedStream(
    const Method& method, const Caller& caller, const Message& request) {
  try {
    auto stream = std::make_shared<ComputedStream>(method, caller, request);
    absl::Status begun = stream->Begin();
    if (!begun.ok()) return begun;
    return stream;
  } catch (const std::system_error&) {
    return ForClient(absl::ResourceExhaustedError(
        "no thread is free for this call: try again in a moment"));
  }
}

}  // namespace selfcal::server
