#include "server/grpc/read_gate.h"

#include <malloc.h>

#include <algorithm>

namespace selfcal::server {
namespace {

// No read reserves less.
constexpr std::int64_t kLeastBytes = 64 << 10;
// A process that takes less memory during a read receives no large message.
constexpr std::int64_t kGrowth = 1 << 20;

std::int64_t HeapBytes() {
  const struct mallinfo2 heap = mallinfo2();
  return static_cast<std::int64_t>(heap.uordblks + heap.hblkhd);
}

}  // namespace

ReadGate::Admission::Admission(MemoryPool::Share share)
    : share_(std::move(share)),
      start_(std::chrono::steady_clock::now()),
      heap_(HeapBytes()) {}

void ReadGate::Admission::Look() {
  const bool is_idle = HeapBytes() - heap_ < kGrowth;
  if (is_idle || std::chrono::steady_clock::now() - start_ > kLongest) End();
}

std::optional<ReadGate::Admission> ReadGate::Enter(
    std::int64_t last_bytes, const std::function<bool()>& cancelled) {
  const bool is_new = last_bytes == 0;
  auto share =
      pool_.Acquire(is_new ? message_bytes_ : std::max(kLeastBytes, last_bytes),
                    cancelled,
                    is_new);
  if (!share) return std::nullopt;
  return Admission(*std::move(share));
}

}  // namespace selfcal::server
