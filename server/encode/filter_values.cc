#include "server/encode/filter_values.h"

#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <type_traits>

namespace selfcal::server {
namespace {

std::int64_t Next(std::int64_t value) { return value + (value != INT64_MAX); }
std::int64_t Before(std::int64_t value) { return value - (value != INT64_MIN); }
double Next(double value) {
  return std::nextafter(value, std::numeric_limits<double>::infinity());
}
double Before(double value) {
  return std::nextafter(value, -std::numeric_limits<double>::infinity());
}

template <typename T>
void Narrow(const std::string& sign, T value, Range<T>* range) {
  if (sign != "<" && sign != "<=") {
    const T least = sign == ">" ? Next(value) : value;
    range->least = std::max(range->least.value_or(least), least);
  }
  if (sign != ">" && sign != ">=") {
    const T most = sign == "<" ? Before(value) : value;
    range->most = std::min(range->most.value_or(most), most);
  }
}

template <typename T>
absl::Status ParseAndNarrow(const FilterTerm& term, Range<T>* range) {
  T value = 0;
  const char* const end = term.value.data() + term.value.size();
  const auto parsed = std::from_chars(term.value.data(), end, value);
  const bool finite = std::isfinite(static_cast<double>(value));
  if (parsed.ec != std::errc() || parsed.ptr != end || !finite) {
    return NotWhatIsExpected(
        term.value, std::is_integral_v<T> ? "a whole number" : "a number");
  }
  Narrow(term.sign, value, range);
  return absl::OkStatus();
}

}  // namespace

absl::Status NarrowByNumber(const FilterTerm& term,
                            Range<std::int64_t>* range) {
  return ParseAndNarrow(term, range);
}

absl::Status NarrowByNumber(const FilterTerm& term, Range<double>* range) {
  return ParseAndNarrow(term, range);
}

absl::Status NarrowByTime(const FilterTerm& term, Range<std::int64_t>* range) {
  google::protobuf::Timestamp time;
  if (!google::protobuf::util::TimeUtil::FromString(term.value, &time)) {
    return NotWhatIsExpected(term.value, "a time as 2026-11-21T04:10:03Z");
  }
  // Times in other years do not fit into 64 bits.
  if (time.seconds() < 0 || time.seconds() > INT64_MAX / 1'000'000'000 - 1) {
    return NotWhatIsExpected(term.value, "a time from 1970 to 2262");
  }
  Narrow(term.sign,
         google::protobuf::util::TimeUtil::TimestampToNanoseconds(time),
         range);
  return absl::OkStatus();
}

absl::Status CheckEquality(const FilterTerm& term) {
  if (term.sign == "=") return absl::OkStatus();
  return NotWhatIsExpected(term.sign,
                           fmt::format("= : {} has no order", term.field));
}

}  // namespace selfcal::server
