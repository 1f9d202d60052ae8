// The time that is stamped on what is stored.
#pragma once

#include <chrono>
#include <cstdint>

namespace selfcal::server {

// Nanoseconds since the Unix epoch.
inline std::int64_t NowNs() {
  return std::chrono::nanoseconds(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace selfcal::server
