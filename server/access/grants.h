// Callers and their rights.
//
// A certificate states rights as URIs in its alternative names:
//
//   selfcal://role/{role}               on every rig
//   selfcal://role/{role}/rigs/{rig}    on this rig only
//   selfcal://role/{role}/labels/{name}/{value}
//                                       on the rigs that have this label
//
// The value of a label is percent-encoded (RFC 3986).
// A role includes those before it: a caller that may produce may also read.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace selfcal::server {

enum class Role { kRead, kProduce, kAdminister };

std::string_view RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

using Label = std::pair<std::string, std::string>;  // name, value

// On every rig, unless it names a rig or a label.
struct Grant {
  Role role = Role::kRead;
  std::string rig = {};
  std::optional<Label> label = {};

  friend bool operator==(const Grant&, const Grant&) = default;
};

struct Caller {
  std::string name;  // for the event log; ASCII, not empty
  std::vector<Grant> grants;
};

// The rigs on which a caller has a role: these, and those with one of the
// labels.
struct RigRights {
  std::set<std::string> rigs;
  std::set<Label> labels;

  bool empty() const { return rigs.empty() && labels.empty(); }
};

// The rigs on which the caller has the role; nullopt: every rig.
std::optional<RigRights> RightsOf(const Caller& caller, Role role);
// True if the rights are on the rig with this name and these labels.
bool Include(const RigRights& rights,
             const std::string& rig,
             const std::map<std::string, std::string>& labels);

// Converts a name from a certificate for the event log: ASCII, limited in
// length.
std::string PrintableName(std::string name);

// Parses a grant from a name of a certificate; nullopt if it is not a grant.
std::optional<Grant> ParseGrant(std::string_view uri);

}  // namespace selfcal::server
