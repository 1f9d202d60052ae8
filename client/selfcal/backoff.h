// Exponential backoff between attempts to connect, with a limit, and with
// jitter, so that a fleet does not reconnect in step after an outage.
#pragma once

#include <chrono>
#include <cstdint>
#include <random>

namespace selfcal::client {

// Not thread-safe.
class Backoff {
 public:
  Backoff(std::chrono::milliseconds min,
          std::chrono::milliseconds max,
          std::uint64_t seed);

  // Returns the time to wait before the next attempt: between half of the
  // current step and all of it. The step starts at `min` and doubles up to
  // `max`.
  std::chrono::milliseconds Next();

  // Sets the step back to `min`, after a success.
  void Reset() { step_ = min_; }

 private:
  std::chrono::milliseconds min_;
  std::chrono::milliseconds max_;
  std::chrono::milliseconds step_;
  std::mt19937_64 random_;
};

}  // namespace selfcal::client
