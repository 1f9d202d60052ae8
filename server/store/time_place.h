// A place in a list of records of all rigs that is sorted by steady time. Times
// of several rigs can be equal, and a rig has a number for each record.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "server/store/store.h"

namespace selfcal::server {

struct TimePlace {
  // Before the newest record.
  std::int64_t steady_ns = std::numeric_limits<std::int64_t>::max();
  std::int64_t rig = 0;  // its key
  std::int64_t number = 0;
};

// The place after which the page begins. INVALID_ARGUMENT for a token of
// another list.
absl::StatusOr<TimePlace> TimePlaceOf(std::string_view list, const Page& page);
// The token of a page after this place.
std::string TokenAfter(std::string_view list, const TimePlace& place);

}  // namespace selfcal::server
