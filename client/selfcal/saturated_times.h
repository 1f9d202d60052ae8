// Arithmetic on times that does not overflow, for any two of them.
#pragma once

#include <cstdint>
#include <limits>

namespace selfcal::client {

// Returns later - earlier.
inline std::uint64_t Elapsed(std::int64_t later_ns, std::int64_t earlier_ns) {
  return static_cast<std::uint64_t>(later_ns) -
         static_cast<std::uint64_t>(earlier_ns);
}

// Times that saturate at the ends of the type.
inline std::int64_t Earlier(std::int64_t t_ns, std::int64_t by_ns) {
  constexpr auto kLowest = std::numeric_limits<std::int64_t>::min();
  return t_ns < kLowest + by_ns ? kLowest : t_ns - by_ns;
}
inline std::int64_t Later(std::int64_t t_ns, std::int64_t by_ns) {
  constexpr auto kHighest = std::numeric_limits<std::int64_t>::max();
  return t_ns > kHighest - by_ns ? kHighest : t_ns + by_ns;
}

}  // namespace selfcal::client
