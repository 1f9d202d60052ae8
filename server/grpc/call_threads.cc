#include "server/grpc/call_threads.h"

#include <chrono>
#include <system_error>
#include <thread>
#include <utility>

namespace selfcal::server {
namespace {

// A thread without work ends after this time.
constexpr std::chrono::seconds kIdle{10};

}  // namespace

CallThreads::~CallThreads() {
  std::unique_lock lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
  changed_.wait(lock, [this] { return threads_ == 0; });
}

bool CallThreads::MakeRoom() {
  if (static_cast<int>(queue_.size()) < idle_) return true;
  if (threads_ >= limit_) return false;
  try {
    std::thread([this] { Work(); }).detach();
  } catch (const std::system_error&) {
    return false;
  }
  ++threads_;
  ++idle_;  // until it takes the work
  return true;
}

bool CallThreads::Run(std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  if (!MakeRoom()) return false;
  queue_.push_back(std::move(work));
  changed_.notify_one();
  return true;
}

void CallThreads::RunSoon(std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  // Without room, a thread takes it when it is done with what it does.
  MakeRoom();
  queue_.push_back(std::move(work));
  changed_.notify_one();
}

void CallThreads::Work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    const bool work = changed_.wait_for(
        lock, kIdle, [this] { return stopping_ || !queue_.empty(); });
    if (queue_.empty() && (stopping_ || !work)) break;
    std::function<void()> next = std::move(queue_.front());
    queue_.pop_front();
    --idle_;
    lock.unlock();
    next();
    next = nullptr;
    lock.lock();
    ++idle_;
  }
  --idle_;
  --threads_;
  changed_.notify_all();
}

}  // namespace selfcal::server
