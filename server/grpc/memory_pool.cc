#include "server/grpc/memory_pool.h"

#include <chrono>
#include <utility>

namespace selfcal::server {
namespace {

constexpr std::int64_t kSmallPart = 16;
constexpr std::int64_t kFreePart = 8;
// Delay after which a waiting Acquire notices that its call has ended.
constexpr std::chrono::milliseconds kCancelPoll{50};

}  // namespace

MemoryPool::Share& MemoryPool::Share::operator=(Share&& other) noexcept {
  if (this != &other) {
    Shrink(0);
    pool_ = std::exchange(other.pool_, nullptr);
    is_large_ = other.is_large_;
    bytes_ = std::exchange(other.bytes_, 0);
  }
  return *this;
}

void MemoryPool::Share::Shrink(std::int64_t bytes) {
  if (pool_ == nullptr || bytes >= bytes_) return;
  pool_->Return(bytes_ - bytes, is_large_, bytes == 0);
  bytes_ = bytes;
  if (bytes == 0) pool_ = nullptr;
}

std::int64_t MemoryPool::held() const {
  const std::lock_guard lock(mutex_);
  return small_bytes_ + large_bytes_;
}

bool MemoryPool::HasRoom(std::int64_t bytes, bool is_large) const {
  const std::int64_t free = bytes_ / kFreePart;
  if (is_large) {
    return large_shares_ == 0 ||
           small_bytes_ + large_bytes_ + bytes <= bytes_ - free;
  }
  return small_bytes_ + bytes <= free ||
         small_bytes_ + large_bytes_ + bytes <= bytes_;
}

std::optional<MemoryPool::Share> MemoryPool::Acquire(
    std::int64_t bytes,
    const std::function<bool()>& cancelled,
    bool is_urgent) {
  const bool is_large = bytes > bytes_ / kSmallPart;
  std::unique_lock lock(mutex_);
  const std::pair ticket(!is_urgent, next_ticket_++);
  if (is_large) waiting_.insert(ticket);
  bool gone = false;
  while (!gone && (!HasRoom(bytes, is_large) ||
                   (is_large && *waiting_.begin() != ticket))) {
    changed_.wait_for(lock, kCancelPoll);
    lock.unlock();
    gone = cancelled();
    lock.lock();
  }
  if (is_large) {
    waiting_.erase(ticket);
    changed_.notify_all();  // it is the next one's turn
  }
  if (gone) return std::nullopt;
  (is_large ? large_bytes_ : small_bytes_) += bytes;
  large_shares_ += is_large;
  Share share;
  share.pool_ = this;
  share.is_large_ = is_large;
  share.bytes_ = bytes;
  return share;
}

void MemoryPool::Return(std::int64_t bytes, bool is_large, bool ends) {
  {
    const std::lock_guard lock(mutex_);
    (is_large ? large_bytes_ : small_bytes_) -= bytes;
    large_shares_ -= is_large && ends;
  }
  changed_.notify_all();
}

}  // namespace selfcal::server
