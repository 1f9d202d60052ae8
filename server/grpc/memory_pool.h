// A bounded amount of memory that calls share. Any thread may call.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

namespace selfcal::server {

// Small shares, of up to a 16th of the pool, never wait for large ones: an 8th
// of the pool is for them alone. Large ones are given in the order in which
// they are wanted; one that is larger than the pool when no other large one is
// held.
class MemoryPool {
 public:
  explicit MemoryPool(std::int64_t bytes) : bytes_(bytes) {}

  // Returns its bytes at its end. The pool must outlive it.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept { *this = std::move(other); }
    Share& operator=(Share&& other) noexcept;
    ~Share() { Shrink(0); }

    // Returns what is held beyond this.
    void Shrink(std::int64_t bytes);
    std::int64_t bytes() const { return bytes_; }

   private:
    friend class MemoryPool;

    MemoryPool* pool_ = nullptr;
    bool is_large_ = false;
    std::int64_t bytes_ = 0;
  };

  // Waits for the bytes; nullopt once `cancelled`, which is asked now and then,
  // returns true. An urgent large share comes before those that are not.
  std::optional<Share> Acquire(std::int64_t bytes,
                               const std::function<bool()>& cancelled,
                               bool is_urgent = false);

  std::int64_t held() const;

 private:
  bool HasRoom(std::int64_t bytes, bool is_large) const;
  void Return(std::int64_t bytes, bool is_large, bool ends);

  const std::int64_t bytes_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::int64_t small_bytes_ = 0;  // held
  std::int64_t large_bytes_ = 0;
  int large_shares_ = 0;
  std::int64_t next_ticket_ = 0;
  // Requests for large shares; the lowest is next.
  std::set<std::pair<bool, std::int64_t>> waiting_;  // not urgent, ticket
};

}  // namespace selfcal::server
