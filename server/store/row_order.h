// The order of a list by columns, and the places in it where its pages begin.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>
#include <vector>

#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

struct RowOrder {
  // All of them together are different for each row.
  std::vector<std::string> columns;
  bool is_real = false;  // the first column; all others are whole numbers
  bool descending = true;
};

// The values of the columns in the row after which a page begins; none: the
// page is the first.
using RowPlace = std::vector<SqlCondition::Value>;

// INVALID_ARGUMENT for a token of another list.
absl::StatusOr<RowPlace> RowPlaceOf(std::string_view list,
                                    const RowOrder& order,
                                    const Page& page);
// The token of a page after this place.
std::string TokenAfter(std::string_view list, const RowPlace& place);

// The place of a row whose columns of the order begin at this one.
RowPlace PlaceOfRow(const RowOrder& order,
                    const Statement& row,
                    int first_column);

// Reads a page of `size` rows of a statement that selects one more, whose
// columns of the order begin at `first_column`: calls `add` with each row.
// Returns the token of the next page; empty if this is the last.
template <typename Add>
absl::StatusOr<std::string> ReadPage(std::string_view list,
                                     const RowOrder& order,
                                     int first_column,
                                     int size,
                                     Statement* read,
                                     const Add& add) {
  RowPlace place;
  for (int count = 0; read->Next(); ++count) {
    if (count == size) return TokenAfter(list, place);
    place = PlaceOfRow(order, *read, first_column);
    add(*read);
  }
  if (!read->status().ok()) return read->status();
  return std::string();
}

// The condition that a row follows the place, if there is one.
void AndAfter(const RowOrder& order, const RowPlace& place, SqlCondition* to);
// The columns with their direction, for ORDER BY.
std::string OrderText(const RowOrder& order);

}  // namespace selfcal::server
