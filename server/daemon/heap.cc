#include "server/daemon/heap.h"

#include <malloc.h>

#include <chrono>

namespace selfcal::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::chrono::seconds kTrimAfter{5};

}  // namespace

void KeepHeapSmall() {
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, 128 << 10);
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
}

void TrimHeap() {
  static SteadyClock::time_point last = SteadyClock::now();
  const auto now = SteadyClock::now();
  if (now - last < kTrimAfter) return;
  last = now;
  malloc_trim(0);
}

}  // namespace selfcal::server
