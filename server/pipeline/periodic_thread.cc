#include "server/pipeline/periodic_thread.h"

#include <utility>

namespace selfcal::server {

void PeriodicThread::Start(Pass pass) {
  const std::lock_guard lock(mutex_);
  running_ = true;
  thread_ = std::thread([this, pass = std::move(pass)] { Run(pass); });
}

void PeriodicThread::Stop() {
  std::thread thread;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    thread.swap(thread_);
  }
  changed_.notify_all();
  if (thread.joinable()) thread.join();
}

void PeriodicThread::Wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
  }
  changed_.notify_all();
}

void PeriodicThread::Run(const Pass& pass) {
  std::unique_lock lock(mutex_);
  while (running_) {
    woken_ = false;
    lock.unlock();
    const std::chrono::milliseconds pause = pass();
    lock.lock();
    changed_.wait_for(lock, min_pause_, [this] { return !running_; });
    changed_.wait_for(lock, pause, [this] { return !running_ || woken_; });
  }
}

}  // namespace selfcal::server
