#include "server/store/paging.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kDefaultPageSize = 50;
constexpr int kMaxPageSize = 1000;

std::string ToHex(std::string_view bytes) {
  std::string hex;
  for (const char c : bytes) {
    hex += fmt::format("{:02x}", static_cast<unsigned char>(c));
  }
  return hex;
}

std::optional<std::string> FromHex(std::string_view hex) {
  if (hex.size() % 2 != 0) {
    return std::nullopt;
  }
  std::string bytes;
  for (std::size_t k = 0; k < hex.size(); k += 2) {
    unsigned value = 0;
    const char* end = hex.data() + k + 2;
    const auto parsed = std::from_chars(hex.data() + k, end, value, 16);
    if (parsed.ec != std::errc() || parsed.ptr != end) {
      return std::nullopt;
    }
    bytes += static_cast<char>(value);
  }
  return bytes;
}

}  // namespace

absl::Status BadPageToken() {
  return absl::InvalidArgumentError(
      "the page token is not one of this list; send the one that came with the "
      "page before, or none for the first page");
}

int PageSize(const Page& page) {
  return page.size <= 0 ? kDefaultPageSize : std::min(page.size, kMaxPageSize);
}

std::string MakePageToken(std::string_view list, std::string_view key) {
  return ToHex(fmt::format("{}\n{}", list, key));
}

std::string MakePageToken(std::string_view list, std::int64_t key) {
  return MakePageToken(list, fmt::format("{}", key));
}

absl::StatusOr<std::optional<std::string>> PageKey(std::string_view list,
                                                   const Page& page) {
  if (page.token.empty()) {
    return std::optional<std::string>();
  }
  const std::optional<std::string> text = FromHex(page.token);
  const std::string prefix = fmt::format("{}\n", list);
  if (!text || !text->starts_with(prefix)) {
    return BadPageToken();
  }
  return std::optional<std::string>(text->substr(prefix.size()));
}

absl::StatusOr<std::optional<std::int64_t>> PageNumber(std::string_view list,
                                                       const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<std::string> key,
                           PageKey(list, page));
  if (!key) {
    return std::optional<std::int64_t>();
  }
  std::int64_t number = 0;
  const char* end = key->data() + key->size();
  const auto parsed = std::from_chars(key->data(), end, number);
  if (parsed.ec != std::errc() || parsed.ptr != end) {
    return BadPageToken();
  }
  return std::optional<std::int64_t>(number);
}

}  // namespace selfcal::server
