// Conditions of a query in SQL, and in the name of a list.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/driver/sql_condition.h"
#include "server/store/range.h"

namespace selfcal::server {

template <typename T>
void AndRange(const std::string& column,
              const Range<T>& range,
              SqlCondition* to) {
  if (range.least) to->And(column + " >= " + to->Parameter(*range.least));
  if (range.most) to->And(column + " <= " + to->Parameter(*range.most));
}

// An enumerator whose number the column has; nullopt: no condition.
template <typename Enum>
void AndIs(const std::string& column,
           const std::optional<Enum>& value,
           SqlCondition* to) {
  if (!value) return;
  to->And(column + " = " + to->Parameter(static_cast<std::int64_t>(*value)));
}

template <typename T>
std::string RangeText(const Range<T>& range) {
  return fmt::format("{}..{}",
                     range.least ? fmt::format("{}", *range.least) : "",
                     range.most ? fmt::format("{}", *range.most) : "");
}

// The number of an enumerator, or nothing.
template <typename Enum>
std::string NumberText(const std::optional<Enum>& value) {
  return value ? fmt::format("{}", static_cast<std::int64_t>(*value)) : "";
}

}  // namespace selfcal::server
