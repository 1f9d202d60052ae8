// The form of labels of rigs.
#pragma once

#include <string_view>

namespace selfcal {

// True for 1 to 63 characters of a-z, 0-9, _ and -, beginning with a letter.
bool IsLabelName(std::string_view name);
// True for at most 63 bytes of printable ASCII.
bool IsLabelValue(std::string_view value);

}  // namespace selfcal
