// What is written into the log of events for whoever reads it later.
#pragma once

#include <string>
#include <string_view>

namespace selfcal::server {

inline constexpr std::string_view kReasonRule =
    "must have 1 to 500 bytes; say why, for whoever reads the log";

inline bool IsReason(const std::string& text) {
  constexpr std::size_t kMaxBytes = 500;
  return !text.empty() && text.size() <= kMaxBytes;
}

}  // namespace selfcal::server
