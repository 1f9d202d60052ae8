// Retries while the environment fails.
#pragma once

#include <absl/status/status.h>

#include <algorithm>
#include <chrono>

namespace selfcal::server {

// True if the same call may succeed later: the disk or the memory failed, not
// the request.
inline bool IsTransient(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsResourceExhausted(status);
}

// The time before the next retry: twice the last, up to 30 s.
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
