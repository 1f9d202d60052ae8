#pragma once

#include <chrono>

namespace selfcal::client {

inline constexpr std::chrono::milliseconds kNow{0};  // asks without a wait

}  // namespace selfcal::client
