// Completes the records of versions that an earlier program has written: a few
// at a time, since nothing but lists depends on it. One thread at a time may
// call.
#pragma once

#include <chrono>

#include "server/domain/domain.h"

namespace selfcal::server {

class VersionCompletion {
 public:
  // The domain must outlive it.
  explicit VersionCompletion(Domain* domain) : domain_(domain) {}

  // Completes the next versions. Once there are none, it looks for others from
  // time to time: an earlier program may still run on the same database.
  void Continue();

 private:
  using Clock = std::chrono::steady_clock;

  Domain* const domain_;
  bool estimates_complete_ = false;
  Clock::time_point look_again_{};  // for versions that no list finds
};

}  // namespace selfcal::server
