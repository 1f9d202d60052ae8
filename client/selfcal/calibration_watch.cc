#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "client/selfcal/backoff.h"
#include "client/selfcal/calibration_version.h"
#include "client/selfcal/client.h"
#include "client/selfcal/connection.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {

class CalibrationWatch::Impl {
 public:
  Impl(const ClientOptions& options, Callback callback)
      : options_(options),
        callback_(std::move(callback)),
        thread_([this] { Run(); }) {}

  ~Impl() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
      if (context_ != nullptr) context_->TryCancel();
    }
    stopped_.notify_all();
    thread_.join();
  }

  absl::Status connection_status() const {
    std::lock_guard lock(mutex_);
    return connection_;
  }

  std::uint64_t callback_failures() const {
    std::lock_guard lock(mutex_);
    return callback_failures_;
  }

 private:
  using Published = std::pair<std::int64_t, CalibrationVersion::Verdict>;

  void Run() {
    Backoff backoff(
        options_.min_backoff, options_.max_backoff, JitterSeed(this));
    do {
      bool answered = false;
      const absl::Status status = TryWatch(&answered);
      if (answered) backoff.Reset();
      std::lock_guard lock(mutex_);
      context_ = nullptr;
      connection_ = status;
    } while (WaitUnlessStopped(backoff.Next()));
  }

  bool WaitUnlessStopped(std::chrono::milliseconds wait) {
    std::unique_lock lock(mutex_);
    stopped_.wait_for(lock, wait, [this] { return stop_; });
    return !stop_;
  }

  absl::Status TryWatch(bool* answered) {
    try {
      return Watch(answered);
    } catch (const std::exception& error) {  // out of memory
      return absl::InternalError(error.what());
    }
  }

  // Handles one connection until it ends; never returns OK.
  absl::Status Watch(bool* answered) {
    const auto channel = MakeChannel(options_);
    if (!channel.ok()) return channel.status();
    const auto stub = v1::CalibrationService::NewStub(*channel);
    const auto context = std::make_shared<grpc::ClientContext>();
    {
      std::lock_guard lock(mutex_);
      if (stop_) return absl::CancelledError();
      context_ = context;
    }
    v1::WatchCalibrationRequest request;
    request.set_parent(RigName(options_.rig));
    const auto stream = stub->WatchCalibration(context.get(), request);
    v1::Calibration message;
    while (stream->Read(&message)) {
      *answered = true;
      Publish(message);
    }
    const absl::Status status = ToAbsl(stream->Finish());
    if (!status.ok()) return status;
    return absl::UnavailableError("the daemon ended the stream");
  }

  void Publish(const v1::Calibration& message) {
    const auto version = ToCalibrationVersion(message);
    {
      std::lock_guard lock(mutex_);
      connection_ = version.status();
    }
    if (!version.ok()) return;
    const Published published = {version->version, version->verdict};
    if (last_published_ == published) return;
    last_published_ = published;
    if (!callback_) return;
    try {
      callback_(*version);
    } catch (...) {
      std::lock_guard lock(mutex_);
      ++callback_failures_;
    }
  }

  const ClientOptions options_;
  const Callback callback_;
  std::optional<Published> last_published_;  // used by thread_ only

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable stopped_;
  bool stop_ = false;
  absl::Status connection_;
  std::uint64_t callback_failures_ = 0;
  std::shared_ptr<grpc::ClientContext> context_;  // while there is one

  std::thread thread_;  // last: it uses all of the above
};

CalibrationWatch::CalibrationWatch(const ClientOptions& options,
                                   Callback callback) noexcept {
  try {
    impl_ = std::make_unique<Impl>(options, std::move(callback));
  } catch (...) {
    impl_ = nullptr;  // as documented: does nothing
  }
}
CalibrationWatch::~CalibrationWatch() = default;

absl::Status CalibrationWatch::connection_status() const noexcept {
  // Has no message, because a message needs memory.
  return impl_ == nullptr
             ? absl::Status(absl::StatusCode::kResourceExhausted, "")
             : impl_->connection_status();
}

std::uint64_t CalibrationWatch::callback_failures() const noexcept {
  return impl_ == nullptr ? 0 : impl_->callback_failures();
}

}  // namespace selfcal::client
