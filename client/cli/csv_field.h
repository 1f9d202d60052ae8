// Fields of CSV (RFC 4180).
#pragma once

#include <string>

namespace selfcal::client {

// Adds quotes if CSV requires them.
inline std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace selfcal::client
