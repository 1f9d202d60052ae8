// The reason that a caller gives for the event log.
#pragma once

#include <string>
#include <string_view>

namespace selfcal::server {

inline constexpr std::string_view kReasonRule =
    "must have 1 to 500 bytes; the event log records the reason";

inline bool IsReason(const std::string& text) {
  constexpr std::size_t kMaxBytes = 500;
  return !text.empty() && text.size() <= kMaxBytes;
}

}  // namespace selfcal::server
