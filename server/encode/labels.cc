#include "server/encode/labels.h"

#include <algorithm>

namespace selfcal::server {
namespace {

constexpr int kMaxLabels = 64;
constexpr std::size_t kMaxBytes = 63;

bool IsLower(char c) { return c >= 'a' && c <= 'z'; }

bool IsName(const std::string& name) {
  return !name.empty() && name.size() <= kMaxBytes && IsLower(name.front()) &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return IsLower(c) || (c >= '0' && c <= '9') || c == '_' || c == '-';
         });
}

bool IsValue(const std::string& value) {
  return value.size() <= kMaxBytes &&
         std::all_of(value.begin(), value.end(), [](char c) {
           return c >= ' ' && c <= '~';
         });
}

}  // namespace

std::vector<Violation> GetLabels(const v1::Rig& message,
                                 std::map<std::string, std::string>* labels) {
  std::vector<Violation> violations;
  if (message.labels_size() > kMaxLabels) {
    violations.push_back({"labels", "has more than 64 labels"});
  }
  for (const auto& [name, value] : message.labels()) {
    if (!IsName(name)) {
      violations.push_back({"labels",
                            "has a name that is not 1 to 63 characters of a-z, "
                            "0-9, _ and -, beginning with a letter"});
    } else if (!IsValue(value)) {
      violations.push_back(
          {"labels." + name, "is not at most 63 bytes of printable ASCII"});
    } else {
      labels->emplace(name, value);
    }
  }
  return violations;
}

}  // namespace selfcal::server
