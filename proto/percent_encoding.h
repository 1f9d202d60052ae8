// Percent-encoding of parts of a path (RFC 3986).
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace selfcal {

// Encodes all but letters, digits, '-', '_' and '.', in capitals.
std::string PercentEncode(std::string_view text);
// nullopt for a '%' without two digits. Other characters stand for themselves.
std::optional<std::string> PercentDecode(std::string_view encoded);

}  // namespace selfcal
