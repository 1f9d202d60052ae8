// Waits of tests for what other threads and processes bring about. Every wait
// of a test has an end, so that a defect fails the test that finds it instead
// of stopping all of them.
#pragma once

#include <chrono>
#include <thread>

namespace selfcal {

// Much longer than anything takes on a busy machine.
inline constexpr std::chrono::seconds kLongWait{60};
// For conditions that cost nothing; those that ask a daemon need a longer one.
inline constexpr std::chrono::milliseconds kShortInterval{1};
inline constexpr std::chrono::milliseconds kDaemonInterval{50};

// Returns whether the condition comes true within the limit; a condition that
// is already true costs no time.
template <typename Condition>
bool Eventually(const Condition& condition,
                std::chrono::nanoseconds limit = kLongWait,
                std::chrono::nanoseconds interval = kShortInterval) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + limit;
  while (!condition()) {
    if (Clock::now() >= end) return false;
    std::this_thread::sleep_for(interval);
  }
  return true;
}

}  // namespace selfcal
