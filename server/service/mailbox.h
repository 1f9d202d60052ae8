// A mailbox between a publisher that must not wait and a watcher that may be
// slow. It holds one value, the newest. Any thread may call.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>

namespace selfcal::server {

template <typename T>
class Mailbox {
 public:
  // Replaces a value that was not taken.
  void Put(T value) {
    {
      const std::lock_guard lock(mutex_);
      value_ = std::move(value);
    }
    arrived_.notify_one();
  }

  // Takes the newest value; nullopt if there is none within the timeout.
  std::optional<T> Take(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, timeout, [this] { return value_.has_value(); });
    return std::exchange(value_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::optional<T> value_;
};

}  // namespace selfcal::server
