// The reason that a caller gives for the event log.
#pragma once

#include <string>
#include <string_view>

#include "proto/safe_text.h"

namespace selfcal::server {

inline constexpr std::string_view kReasonRule =
    "must be one line of 1 to 500 bytes without control characters; the event "
    "log records the reason";

inline bool IsReason(const std::string& text) {
  constexpr std::size_t kMaxBytes = 500;
  return !text.empty() && text.size() <= kMaxBytes && SafeLine(text) == text;
}

}  // namespace selfcal::server
