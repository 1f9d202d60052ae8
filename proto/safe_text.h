// Text from outside, made safe for messages, logs, lists and terminals.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal {

// Converts any bytes to one line of valid UTF-8, of at most max_bytes:
// truncated between characters, with an ellipsis, and with '?' for each
// character that controls a terminal, ends a line or changes the direction of
// the text, and for each byte that is not UTF-8.
std::string SafeLine(std::string_view text,
                     std::size_t max_bytes = std::string_view::npos);

// The same for text of several lines: '\n' and '\t' stay.
std::string SafeLines(std::string_view text);

}  // namespace selfcal
