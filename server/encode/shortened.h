// Sanitises text from outside for a message or a log.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::server {

// Converts any bytes to valid UTF-8 of at most max_bytes: truncated between
// characters, with an ellipsis, and with '?' for control characters and for
// bytes that are not UTF-8.
std::string Shortened(std::string_view text, std::size_t max_bytes);

}  // namespace selfcal::server
