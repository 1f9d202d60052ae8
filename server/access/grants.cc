#include "server/access/grants.h"

#include <algorithm>
#include <array>
#include <utility>

#include "proto/label_text.h"
#include "proto/percent_encoding.h"
#include "proto/resource_names.h"

namespace selfcal::server {
namespace {

constexpr std::array<std::pair<Role, std::string_view>, 3> kRoles = {{
    {Role::kRead, "read"},
    {Role::kProduce, "produce"},
    {Role::kAdminister, "administer"},
}};
constexpr std::string_view kScheme = "selfcal://role/";
constexpr std::string_view kLabels = "/labels/";
constexpr std::size_t kMaxName = 100;

// Parses NAME/VALUE.
std::optional<Label> ParseLabel(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == text.npos) return std::nullopt;
  const std::string_view name = text.substr(0, slash);
  const std::string_view encoded = text.substr(slash + 1);
  auto value = PercentDecode(encoded);
  if (!IsLabelName(name) || encoded.find('/') != encoded.npos || !value ||
      !IsLabelValue(*value)) {
    return std::nullopt;
  }
  return Label(name, *std::move(value));
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
  // An invalid name would grant nothing or, if empty, everything.
  auto rig = ParseRigName(uri.substr(1));
  if (!rig) return std::nullopt;
  return Grant{*role, *std::move(rig)};
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
