// The terms of the filter and the order of a list request, as text. Internal to
// server/encode.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace selfcal::server {

// Most characters of a part of a filter that an error repeats.
inline constexpr std::size_t kMaxTermShown = 60;

// A condition, e.g. gain.camera >= 2. A text alone has a value only.
struct FilterTerm {
  std::string field;
  std::string group;  // after the dot of the field, if there is one
  std::string sign;   // = < <= > >=
  std::string value;
};

// Whether a text alone is a condition.
enum class LoneTexts { kRefused, kAllowed };

// Calls `apply` for each condition, which are joined by AND, until it fails.
// INVALID_ARGUMENT says where and what was expected.
absl::Status ForEachTerm(
    std::string_view filter,
    LoneTexts lone_texts,
    const std::function<absl::Status(const FilterTerm& term)>& apply);

// A field to sort by, then asc or desc.
struct ListOrder {
  std::string field;
  bool descending = false;
};
// `direction` is used if the text has none. The text must not be empty.
absl::StatusOr<ListOrder> ParseOrder(std::string_view order_by,
                                     std::string_view direction);

// INVALID_ARGUMENT: "'`what`' is not `expected`".
absl::Status NotWhatIsExpected(std::string_view what,
                               std::string_view expected);

}  // namespace selfcal::server
