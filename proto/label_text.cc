#include "proto/label_text.h"

#include <algorithm>
#include <cstddef>

namespace selfcal {
namespace {

constexpr std::size_t kMaxBytes = 63;

bool IsLower(char c) { return c >= 'a' && c <= 'z'; }

}  // namespace

bool IsLabelName(std::string_view name) {
  return !name.empty() && name.size() <= kMaxBytes && IsLower(name.front()) &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return IsLower(c) || (c >= '0' && c <= '9') || c == '_' || c == '-';
         });
}

bool IsLabelValue(std::string_view value) {
  return value.size() <= kMaxBytes &&
         std::all_of(value.begin(), value.end(), [](char c) {
           return c >= ' ' && c <= '~';
         });
}

}  // namespace selfcal
