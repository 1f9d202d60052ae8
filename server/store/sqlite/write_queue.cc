#include "server/store/sqlite/write_queue.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace selfcal::server {

void WriteQueue::Push(QueuedWrite write) {
  {
    const std::lock_guard lock(mutex_);
    writes_.push_back(std::move(write));
  }
  arrived_.notify_all();
}

void WriteQueue::PushIfEmpty(QueuedWrite write) {
  {
    const std::lock_guard lock(mutex_);
    if (!writes_.empty()) return;
    writes_.push_back(std::move(write));
  }
  arrived_.notify_all();
}

void WriteQueue::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  arrived_.notify_all();
}

std::vector<QueuedWrite> WriteQueue::Take(std::size_t max) {
  std::unique_lock lock(mutex_);
  arrived_.wait(lock, [this] { return stopped_ || !writes_.empty(); });
  const auto end =
      std::next(writes_.begin(),
                static_cast<std::ptrdiff_t>(std::min(writes_.size(), max)));
  std::vector<QueuedWrite> taken(std::make_move_iterator(writes_.begin()),
                                 std::make_move_iterator(end));
  writes_.erase(writes_.begin(), end);
  return taken;
}

}  // namespace selfcal::server
