// Callers and their rights.
//
// A certificate states rights as URIs in its alternative names:
//
//   selfcal://role/{role}               on every rig
//   selfcal://role/{role}/rigs/{rig}    on this rig only
//
// A role includes those before it: a caller that may produce may also read.
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
  std::string name;  // for the event log; ASCII, not empty
  std::vector<Grant> grants;
};

// Converts a name from a certificate for the event log: ASCII, limited in
// length.
std::string PrintableName(std::string name);

// Parses a grant from a name of a certificate; nullopt if it is not a grant.
std::optional<Grant> ParseGrant(std::string_view uri);

}  // namespace selfcal::server
