// Waiting for an environment that has failed to come back.
#pragma once

#include <absl/status/status.h>

#include <algorithm>
#include <chrono>

namespace selfcal::server {

// Whether the same call may succeed later: it is the disk or the memory, not
// the question, that is at fault.
inline bool IsTransient(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsResourceExhausted(status);
}

// The time before the next try: twice the last, up to half a minute.
class Backoff {
 public:
  std::chrono::milliseconds Next() {
    const std::chrono::milliseconds current = next_;
    next_ = std::min(2 * next_, std::chrono::milliseconds(30'000));
    return current;
  }
  void Reset() { next_ = kFirst; }

 private:
  static constexpr std::chrono::milliseconds kFirst{250};
  std::chrono::milliseconds next_ = kFirst;
};

}  // namespace selfcal::server
