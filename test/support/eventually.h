// Waits of tests for what other threads and processes bring about. Every wait
// of a test has an end, so that a defect fails the test that finds it instead
// of stopping all of them. Time during which the test itself does not run,
// because it is stopped or starved, hardly counts: what it waits for does not
// run then either.
#pragma once

#include <algorithm>
#include <chrono>
#include <thread>

namespace selfcal {

// Much longer than anything takes on a busy machine.
inline constexpr std::chrono::seconds kLongWait{60};
// For conditions that cost nothing; those that ask a daemon need a longer one.
inline constexpr std::chrono::milliseconds kShortInterval{1};
inline constexpr std::chrono::milliseconds kDaemonInterval{50};

// Returns whether the condition comes true within the limit, of which each look
// at it uses up no more than a second; a condition that is already true costs
// no time.
template <typename Condition>
bool Eventually(const Condition& condition,
                std::chrono::nanoseconds limit = kLongWait,
                std::chrono::nanoseconds interval = kShortInterval) {
  using Clock = std::chrono::steady_clock;
  const Clock::duration longest_look = std::chrono::seconds(1);
  Clock::duration waited = Clock::duration::zero();
  auto last = Clock::now();
  while (!condition()) {
    if (waited >= limit) return false;
    std::this_thread::sleep_for(interval);
    const auto now = Clock::now();
    waited += std::min(now - last, longest_look);
    last = now;
  }
  return true;
}

}  // namespace selfcal
