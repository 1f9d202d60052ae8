// Applies the values of the terms of a filter to the parts of a query.
// INVALID_ARGUMENT says what a value should be. Internal to server/encode.
#pragma once

#include <absl/status/status.h>
#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/encode/filter_terms.h"
#include "server/status/status_macros.h"
#include "server/store/range.h"

namespace selfcal::server {

// Narrow the range by a condition; several conditions on a field all apply.
absl::Status NarrowByNumber(const FilterTerm& term, Range<std::int64_t>* range);
absl::Status NarrowByNumber(const FilterTerm& term, Range<double>* range);
// The value is a time (RFC 3339), the range one of nanoseconds since the Unix
// epoch.
absl::Status NarrowByTime(const FilterTerm& term, Range<std::int64_t>* range);

// Refuses any operator but '='.
absl::Status CheckEquality(const FilterTerm& term);

// The value is one of some words, such as the names of an enumeration; `what`
// is what they are, "a state".
template <typename Enum>
absl::Status ReadWord(
    const FilterTerm& term,
    std::string_view what,
    std::initializer_list<std::pair<std::string_view, Enum>> words,
    std::optional<Enum>* value) {
  SELFCAL_RETURN_IF_ERROR(CheckEquality(term));
  std::string expected = fmt::format("{}:", what);
  std::size_t left = words.size();
  for (const auto& [word, meaning] : words) {
    if (term.value == word) {
      *value = meaning;
      return absl::OkStatus();
    }
    --left;
    expected += fmt::format(" {}{}",
                            word,
                            left > 1    ? ","
                            : left == 1 ? " or"
                                        : "");
  }
  return NotWhatIsExpected(term.value, expected);
}

}  // namespace selfcal::server
