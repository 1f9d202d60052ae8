#include "client/cli/time_input.h"

#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <charconv>
#include <optional>
#include <string_view>

namespace selfcal::client {
namespace {

using google::protobuf::Timestamp;
using google::protobuf::util::TimeUtil;

std::optional<std::int64_t> SecondsOf(char unit) {
  switch (unit) {
    case 's':
      return 1;
    case 'm':
      return 60;
    case 'h':
      return 3600;
    case 'd':
      return 86400;
    default:
      return std::nullopt;
  }
}

// Parses a duration such as "7d"; at most a hundred years.
std::optional<std::int64_t> ParseAge(std::string_view text) {
  if (text.size() < 2) return std::nullopt;
  const auto unit = SecondsOf(text.back());
  std::int64_t count = 0;
  const char* const end = text.data() + text.size() - 1;
  const auto [stopped, error] = std::from_chars(text.data(), end, count);
  constexpr std::int64_t kHundredYears = 36525 * 86400LL;
  if (!unit || error != std::errc() || stopped != end || count < 0 ||
      count > kHundredYears / *unit) {
    return std::nullopt;
  }
  return count * *unit;
}

}  // namespace

absl::StatusOr<Timestamp> ParseTime(const std::string& text,
                                    const Timestamp& now) {
  Timestamp time;
  if (const auto age = ParseAge(text)) {
    time.set_seconds(now.seconds() - *age);
    time.set_nanos(now.nanos());
    return time;
  }
  constexpr std::size_t kDate = 10;
  std::string rfc3339 = text;
  if (text.size() == kDate) rfc3339 += "T00:00:00";
  if (rfc3339.size() > kDate && rfc3339[kDate] == ' ') rfc3339[kDate] = 'T';
  if (!rfc3339.empty() && rfc3339.back() != 'Z') rfc3339 += 'Z';
  if (TimeUtil::FromString(rfc3339, &time)) return time;
  return absl::InvalidArgumentError(
      fmt::format("'{}' is not a time: use 2026-11-21, '2026-11-21 04:10:03' "
                  "(UTC), or 30s, "
                  "15m, 2h, 7d ago",
                  text));
}

}  // namespace selfcal::client
