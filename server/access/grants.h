// Who calls, and what it may do.
//
// A certificate states rights as URIs among its alternative names:
//
//   selfcal://role/{role}               on every rig
//   selfcal://role/{role}/rigs/{rig}    on this rig alone
//
// A role includes those before it: who may produce may read.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace selfcal::server {

enum class Role { kRead, kProduce, kAdminister };

std::string_view RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

struct Grant {
  Role role = Role::kRead;
  std::string rig;  // empty: every rig

  friend bool operator==(const Grant&, const Grant&) = default;
};

struct Caller {
  std::string name;  // for the log of events; ASCII, not empty
  std::vector<Grant> grants;
};

// A name out of a certificate for the log of events: ASCII, and not too long.
std::string PrintableName(std::string name);

// What the name of a certificate grants; nothing for any other name.
std::optional<Grant> ParseGrant(std::string_view uri);

}  // namespace selfcal::server
