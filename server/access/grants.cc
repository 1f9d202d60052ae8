#include "server/access/grants.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace selfcal::server {
namespace {

constexpr std::array<std::pair<Role, std::string_view>, 3> kRoles = {{
    {Role::kRead, "read"},
    {Role::kProduce, "produce"},
    {Role::kAdminister, "administer"},
}};
constexpr std::string_view kScheme = "selfcal://role/";
constexpr std::string_view kRigs = "/rigs/";
constexpr std::string_view kLabels = "/labels/";
// Of a rig, and of the name and the value of a label.
constexpr std::size_t kMaxRigId = 63;
constexpr std::size_t kMaxLabel = 63;
constexpr std::size_t kMaxName = 100;

constexpr std::string_view kNameCharacters =
    "abcdefghijklmnopqrstuvwxyz0123456789_-";

// True for a valid id of a rig. An invalid one would grant nothing or, if
// empty, everything.
bool IsRigId(std::string_view id) {
  return !id.empty() && id.size() <= kMaxRigId &&
         id.find_first_not_of(kNameCharacters) == id.npos;
}

bool IsLabelName(std::string_view name) {
  return !name.empty() && name.size() <= kMaxLabel && name.front() >= 'a' &&
         name.front() <= 'z' &&
         name.find_first_not_of(kNameCharacters) == name.npos;
}

std::optional<int> HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

// The text without its percent-encoding, if it is the value of a label.
std::optional<std::string> DecodeValue(std::string_view encoded) {
  std::string value;
  for (std::size_t k = 0; k < encoded.size(); ++k) {
    char c = encoded[k];
    if (c == '/') return std::nullopt;
    if (c == '%') {
      if (k + 2 >= encoded.size()) return std::nullopt;
      const auto high = HexDigit(encoded[k + 1]);
      const auto low = HexDigit(encoded[k + 2]);
      if (!high || !low) return std::nullopt;
      c = static_cast<char>(*high * 16 + *low);
      k += 2;
    }
    if (c < ' ' || c > '~') return std::nullopt;
    value += c;
  }
  if (value.size() > kMaxLabel) return std::nullopt;
  return value;
}

// Parses NAME/VALUE.
std::optional<Label> ParseLabel(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == text.npos || !IsLabelName(text.substr(0, slash))) {
    return std::nullopt;
  }
  auto value = DecodeValue(text.substr(slash + 1));
  if (!value) return std::nullopt;
  return Label(text.substr(0, slash), *std::move(value));
}

}  // namespace

std::string_view RoleName(Role role) {
  for (const auto& [known, name] : kRoles) {
    if (known == role) return name;
  }
  return "";
}

std::optional<Role> ParseRole(std::string_view name) {
  for (const auto& [role, known] : kRoles) {
    if (known == name) return role;
  }
  return std::nullopt;
}

std::string PrintableName(std::string name) {
  std::replace_if(
      name.begin(),
      name.end(),
      [](char c) { return c < 0x20 || c > 0x7e; },
      '?');
  return name.substr(0, kMaxName);
}

std::optional<Grant> ParseGrant(std::string_view uri) {
  if (!uri.starts_with(kScheme)) return std::nullopt;
  uri.remove_prefix(kScheme.size());
  const std::size_t slash = uri.find('/');
  const auto role = ParseRole(uri.substr(0, slash));
  if (!role) return std::nullopt;
  if (slash == uri.npos) return Grant{*role};
  uri.remove_prefix(slash);
  if (uri.starts_with(kLabels)) {
    auto label = ParseLabel(uri.substr(kLabels.size()));
    if (!label) return std::nullopt;
    return Grant{*role, "", std::move(label)};
  }
  if (!uri.starts_with(kRigs)) return std::nullopt;
  uri.remove_prefix(kRigs.size());
  if (!IsRigId(uri)) return std::nullopt;
  return Grant{*role, std::string(uri)};
}

std::optional<RigRights> RightsOf(const Caller& caller, Role role) {
  RigRights rights;
  for (const Grant& grant : caller.grants) {
    if (grant.role < role) continue;
    if (grant.label) {
      rights.labels.insert(*grant.label);
    } else if (!grant.rig.empty()) {
      rights.rigs.insert(grant.rig);
    } else {
      return std::nullopt;
    }
  }
  return rights;
}

bool Include(const RigRights& rights,
             const std::string& rig,
             const std::map<std::string, std::string>& labels) {
  return rights.rigs.contains(rig) ||
         std::any_of(labels.begin(), labels.end(), [&](const auto& label) {
           return rights.labels.contains(label);
         });
}

}  // namespace selfcal::server
