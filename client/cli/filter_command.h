// The --filter of a list whose items the program tests.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/cli/list_filter.h"
#include "client/cli/list_options.h"

namespace selfcal::client {

// The conditions of a filter.
template <typename Item>
struct ItemFilter {
  // Returns true for an item that meets them, for CallForItems; empty without a
  // filter.
  std::function<bool(const Item&)> test;
  std::string for_daemon;  // ListFilter::ForDaemon
};

// The errors are those of ListFilter::Parse.
template <typename Item>
absl::StatusOr<ItemFilter<Item>> Wanted(
    const ListOptions& options,
    const std::vector<FilterField>& fields,
    FieldValue (*value)(const Item& item, std::string_view field)) {
  if (options.filter.empty()) return ItemFilter<Item>();
  auto filter =
      ListFilter::Parse(options.filter,
                        fields,
                        google::protobuf::util::TimeUtil::GetCurrentTime());
  if (!filter.ok()) return filter.status();
  ItemFilter<Item> wanted;
  wanted.for_daemon = filter->ForDaemon();
  wanted.test = [filter = *std::move(filter), value](const Item& item) {
    return filter.Meets(
        [&item, value](std::string_view field) { return value(item, field); });
  };
  return wanted;
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
