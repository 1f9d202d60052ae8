// The clock that gives the time of what is stored (Moment).
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>

#include "server/store/moment.h"

namespace selfcal::server {

// Nanoseconds since the Unix epoch.
inline std::int64_t NowNs() {
  return std::chrono::nanoseconds(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

using Clock = std::function<Moment()>;

}  // namespace selfcal::server
