#include "server/store/row_order.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstddef>
#include <cstdint>
#include <variant>

#include "server/status/status_macros.h"
#include "server/store/paging.h"

namespace selfcal::server {
namespace {

bool IsReal(const RowOrder& order, std::size_t column) {
  return column == 0 && order.is_real;
}

absl::StatusOr<SqlCondition::Value> ReadValue(const std::string& text,
                                              bool is_real) {
  double real = 0;
  std::int64_t whole = 0;
  if (is_real && absl::SimpleAtod(text, &real)) return real;
  if (!is_real && absl::SimpleAtoi(text, &whole)) return whole;
  return BadPageToken();
}

std::string ValueText(const SqlCondition::Value& value) {
  return std::visit(
      [](const auto& number) { return fmt::format("{}", number); }, value);
}

}  // namespace

absl::StatusOr<RowPlace> RowPlaceOf(std::string_view list,
                                    const RowOrder& order,
                                    const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto key, PageKey(list, page));
  RowPlace place;
  if (!key) return place;
  const std::vector<std::string> numbers = absl::StrSplit(*key, ' ');
  if (numbers.size() != order.columns.size()) return BadPageToken();
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    SELFCAL_ASSIGN_OR_RETURN(place.emplace_back(),
                             ReadValue(numbers[k], IsReal(order, k)));
  }
  return place;
}

std::string TokenAfter(std::string_view list, const RowPlace& place) {
  std::vector<std::string> numbers;
  for (const SqlCondition::Value& value : place) {
    numbers.push_back(ValueText(value));
  }
  return MakePageToken(list, fmt::format("{}", fmt::join(numbers, " ")));
}

RowPlace PlaceOfRow(const RowOrder& order,
                    const Statement& row,
                    int first_column) {
  RowPlace place;
  for (std::size_t k = 0; k < order.columns.size(); ++k) {
    const int column = first_column + static_cast<int>(k);
    if (IsReal(order, k)) {
      place.emplace_back(row.Double(column));
    } else {
      place.emplace_back(row.Int(column));
    }
  }
  return place;
}

void AndAfter(const RowOrder& order, const RowPlace& place, SqlCondition* to) {
  if (place.empty()) return;
  std::vector<std::string> values;
  for (const SqlCondition::Value& value : place) {
    values.push_back(to->Parameter(value));
  }
  to->And(fmt::format("({}) {} ({})",
                      fmt::join(order.columns, ", "),
                      order.descending ? "<" : ">",
                      fmt::join(values, ", ")));
}

std::string OrderText(const RowOrder& order) {
  const char* const way = order.descending ? " DESC" : " ASC";
  return fmt::format(
      "{}{}", fmt::join(order.columns, std::string(way) + ", "), way);
}

}  // namespace selfcal::server
