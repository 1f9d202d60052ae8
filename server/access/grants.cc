#include "server/access/grants.h"

#include <algorithm>
#include <array>
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
constexpr std::size_t kMaxRigId = 63;
constexpr std::size_t kMaxName = 100;

// True for a valid id of a rig. An invalid one would grant nothing or, if
// empty, everything.
bool IsRigId(std::string_view id) {
  return !id.empty() && id.size() <= kMaxRigId &&
         id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-") ==
             id.npos;
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
  if (slash == uri.npos) return Grant{*role, ""};
  uri.remove_prefix(slash);
  if (!uri.starts_with(kRigs)) return std::nullopt;
  uri.remove_prefix(kRigs.size());
  if (!IsRigId(uri)) return std::nullopt;
  return Grant{*role, std::string(uri)};
}

}  // namespace selfcal::server
