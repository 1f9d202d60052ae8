#include "client/cli/error_lines.h"

#include <fmt/format.h>

#include <algorithm>

namespace selfcal::client {

std::string UserName(const std::string& field, const FlagNames& flags) {
  // The longest path comes first in the reversed order.
  for (auto flag = flags.rbegin(); flag != flags.rend(); ++flag) {
    const std::string& path = flag->first;
    if (!field.starts_with(path)) continue;
    const bool whole = field.size() == path.size() ||
                       field[path.size()] == '.' || field[path.size()] == '[';
    if (whole) return flag->second;
  }
  return field;
}

std::string ErrorLines(const std::vector<Violation>& violations,
                       const FlagNames& flags,
                       std::size_t more) {
  std::string lines;
  const std::size_t shown = std::min(violations.size(), kMostErrorLines);
  for (std::size_t i = 0; i < shown; ++i) {
    const Violation& violation = violations[i];
    lines += violation.field.empty()
                 ? fmt::format("\n  {}", violation.message)
                 : fmt::format("\n  {}: {}",
                               UserName(violation.field, flags),
                               violation.message);
  }
  more += violations.size() - shown;
  if (more > 0) {
    lines +=
        fmt::format("\n  and {} more: {} errors in all", more, shown + more);
  }
  return lines;
}

}  // namespace selfcal::client
