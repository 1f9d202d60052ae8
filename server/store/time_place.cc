#include "server/store/time_place.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <vector>

#include "server/status/status_macros.h"
#include "server/store/paging.h"

namespace selfcal::server {

absl::StatusOr<TimePlace> TimePlaceOf(std::string_view list, const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(list, page));
  TimePlace place;
  if (!key) return place;
  const std::vector<std::string> numbers = absl::StrSplit(*key, ' ');
  if (numbers.size() == 3 && absl::SimpleAtoi(numbers[0], &place.steady_ns) &&
      absl::SimpleAtoi(numbers[1], &place.rig) &&
      absl::SimpleAtoi(numbers[2], &place.number)) {
    return place;
  }
  return BadPageToken();
}

std::string TokenAfter(std::string_view list, const TimePlace& place) {
  return MakePageToken(
      list, fmt::format("{} {} {}", place.steady_ns, place.rig, place.number));
}

}  // namespace selfcal::server
