// Text that came from elsewhere, for a message or a log.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::server {

// A text of any bytes as valid UTF-8 of at most max_bytes: cut between
// characters, with an ellipsis; '?' for control characters and for bytes that
// are no UTF-8.
std::string Shortened(std::string_view text, std::size_t max_bytes);

}  // namespace selfcal::server
