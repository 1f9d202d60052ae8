// Colours of a table on a terminal.
#pragma once

#include <string>
#include <string_view>

namespace selfcal::client {

// Returns the header of a column in bold.
std::string StyledHeader(std::string_view text);

// Returns the cell of a column, or of a fact with this key, coloured if it is a
// state or a verdict: green if it is good, yellow if it is not final or weak,
// red if it is bad. `padded` is the cell with its padding.
std::string StyledCell(std::string_view column,
                       std::string_view cell,
                       std::string padded);

}  // namespace selfcal::client
