#include "client/cli/positive_number.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

namespace selfcal::client {
namespace {

template <typename Number>
std::optional<Number> Parse(const std::string& text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || rest != end) return std::nullopt;
  return number;
}

}  // namespace

CLI::Validator AtLeastOne() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        const auto number = Parse<std::int64_t>(text);
        if (number && *number >= 1) return "";
        return fmt::format("'{}' must be a whole number of at least 1", text);
      },
      "POSITIVE");
}

CLI::Validator AboveZero() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        const auto number = Parse<double>(text);
        if (number && std::isfinite(*number) && *number > 0) return "";
        return fmt::format("'{}' must be a number greater than 0", text);
      },
      "POSITIVE");
}

}  // namespace selfcal::client
