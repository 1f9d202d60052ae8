#include "client/cli/cell_style.h"

#include <algorithm>
#include <array>
#include <utility>

namespace selfcal::client {
namespace {

constexpr std::string_view kBold = "\033[1m";
constexpr std::string_view kGreen = "\033[32m";
constexpr std::string_view kYellow = "\033[33m";
constexpr std::string_view kRed = "\033[31m";
constexpr std::string_view kNormal = "\033[0m";

constexpr std::array<std::string_view, 2> kColoured = {"state", "verdict"};

constexpr std::array<std::pair<std::string_view, std::string_view>, 14>
    kStyles = {{{"active", kGreen},
                {"good", kGreen},
                {"scored", kGreen},
                {"succeeded", kGreen},
                {"candidate", kYellow},
                {"pending", kYellow},
                {"running", kYellow},
                {"stored", kYellow},
                {"weak", kYellow},
                {"cancelled", kRed},
                {"failed", kRed},
                {"not trustworthy", kRed},
                {"rejected", kRed},
                {"unusable", kRed}}};

}  // namespace

std::string StyledHeader(std::string_view text) {
  return std::string(kBold).append(text).append(kNormal);
}

std::string StyledCell(std::string_view column,
                       std::string_view cell,
                       std::string padded) {
  if (std::find(kColoured.begin(), kColoured.end(), column) ==
      kColoured.end()) {
    return padded;
  }
  const auto style =
      std::find_if(kStyles.begin(), kStyles.end(), [cell](const auto& known) {
        return known.first == cell;
      });
  if (style == kStyles.end()) return padded;
  return std::string(style->second).append(padded).append(kNormal);
}

}  // namespace selfcal::client
