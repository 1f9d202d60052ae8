#include "server/grpc/watch_sender.h"

#include <utility>

namespace selfcal::server {

WatchSender::WatchSender(int limit)
    : limit_(static_cast<std::size_t>(limit)), thread_([this] { Run(); }) {}

WatchSender::~WatchSender() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool WatchSender::Add(const std::shared_ptr<SentWatch>& watch) {
  const std::lock_guard lock(mutex_);
  if (watches_.size() >= limit_) return false;
  watches_.insert(watch);
  return true;
}

void WatchSender::Remove(const std::shared_ptr<SentWatch>& watch) {
  const std::lock_guard lock(mutex_);
  watches_.erase(watch);
}

void WatchSender::Schedule(const std::shared_ptr<SentWatch>& watch) {
  {
    const std::lock_guard lock(mutex_);
    if (!queued_.insert(watch.get()).second) return;
    queue_.push_back(watch);
  }
  changed_.notify_one();
}

void WatchSender::ScheduleAll() {
  {
    const std::lock_guard lock(mutex_);
    for (const auto& watch : watches_) {
      if (queued_.insert(watch.get()).second) queue_.push_back(watch);
    }
  }
  changed_.notify_one();
}

void WatchSender::Run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
    if (stopping_) return;
    std::shared_ptr<SentWatch> watch = std::move(queue_.front());
    queue_.pop_front();
    queued_.erase(watch.get());
    if (watches_.find(watch) == watches_.end()) continue;
    lock.unlock();
    watch->Send();
    watch.reset();
    lock.lock();
  }
}

}  // namespace selfcal::server
