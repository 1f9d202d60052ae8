#include "server/api/watch_queue.h"

#include <algorithm>
#include <utility>

namespace selfcal::server {

WatchQueue::WatchQueue(std::function<void()> arrived)
    : notify_(std::move(arrived)) {}

void WatchQueue::SetGate(std::function<absl::Status()> gate) {
  const std::lock_guard lock(mutex_);
  gate_ = std::move(gate);
}

void WatchQueue::Put(const std::string& key, Encode update) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    const auto waiting =
        std::find_if(updates_.begin(), updates_.end(), [&](const Update& u) {
          return u.key == key;
        });
    if (waiting != updates_.end()) {
      waiting->encode = std::move(update);
      return;
    }
    if (updates_.size() < kCapacity) {
      updates_.push_back({key, std::move(update)});
    } else if (summary_) {
      updates_.clear();
      updates_.push_back({"", summary_});
    } else {
      updates_.pop_front();
      updates_.push_back({key, std::move(update)});
    }
  }
  arrived_.notify_one();
  if (notify_) notify_();
}

void WatchQueue::SetSummary(Encode summary) {
  const std::lock_guard lock(mutex_);
  summary_ = std::move(summary);
}

void WatchQueue::Close(absl::Status status) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    closed_ = true;
    status_ = std::move(status);
  }
  arrived_.notify_one();
  if (notify_) notify_();
}

WatchQueue::Taken WatchQueue::TakeLocked() {
  if (updates_.empty()) return {nullptr, closed_, status_};
  Taken taken{std::move(updates_.front().encode), false, absl::OkStatus()};
  updates_.pop_front();
  if (gate_) {
    taken.update = [gate = gate_, update = std::move(taken.update)]()
        -> absl::StatusOr<std::shared_ptr<const WatchUpdate>> {
      const absl::Status passes = gate();
      if (!passes.ok()) return passes;
      return update();
    };
  }
  return taken;
}

WatchQueue::Taken WatchQueue::Take() {
  const std::lock_guard lock(mutex_);
  return TakeLocked();
}

WatchQueue::Taken WatchQueue::Take(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  arrived_.wait_for(
      lock, timeout, [this] { return closed_ || !updates_.empty(); });
  return TakeLocked();
}

}  // namespace selfcal::server
