// The --filter of a list that the daemon does not filter.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/util/time_util.h>

#include <functional>
#include <string_view>
#include <vector>

#include "client/cli/list_filter.h"
#include "client/cli/list_options.h"

namespace selfcal::client {

// Returns whether an item meets the filter, for CallForItems; empty without a
// filter. The errors are those of ListFilter::Parse.
template <typename Item>
absl::StatusOr<std::function<bool(const Item&)>> Wanted(
    const ListOptions& options,
    const std::vector<FilterField>& fields,
    FieldValue (*value)(const Item& item, std::string_view field)) {
  using Test = std::function<bool(const Item&)>;
  if (options.filter.empty()) return Test();
  auto filter =
      ListFilter::Parse(options.filter,
                        fields,
                        google::protobuf::util::TimeUtil::GetCurrentTime());
  if (!filter.ok()) return filter.status();
  return Test([filter = *std::move(filter), value](const Item& item) {
    return filter.Meets(
        [&item, value](std::string_view field) { return value(item, field); });
  });
}

// Returns the words that an enumeration of the contract has, without the
// unspecified one.
template <typename Enum>
std::vector<std::string> WordsOf(const google::protobuf::EnumDescriptor* values,
                                 std::string (*text)(Enum value)) {
  std::vector<std::string> words;
  for (int k = 0; k < values->value_count(); ++k) {
    const int number = values->value(k)->number();
    if (number == 0) continue;
    std::string word = text(static_cast<Enum>(number));
    std::replace(word.begin(), word.end(), ' ', '-');
    words.push_back(std::move(word));
  }
  return words;
}

}  // namespace selfcal::client
