#include "server/access/rules.h"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include "selfcal/v1/access.pb.h"

namespace selfcal::server {
namespace {

using google::protobuf::Message;

// Returns the string at a path such as "rig.name"; empty if a message on the
// path is missing.
std::string TextAt(const Message& message, std::string_view path) {
  const std::size_t dot = path.find('.');
  const auto* field = message.GetDescriptor()->FindFieldByName(
      std::string(path.substr(0, dot)));
  if (field == nullptr) return "";
  const auto& reflection = *message.GetReflection();
  if (dot == path.npos) return reflection.GetString(message, field);
  return TextAt(reflection.GetMessage(message, field), path.substr(dot + 1));
}

// Returns the {rig} of "rigs/{rig}" and "rigs/{rig}/..."; empty for other
// forms.
std::string RigOf(std::string_view name) {
  constexpr std::string_view kRigs = "rigs/";
  if (!name.starts_with(kRigs)) return "";
  name.remove_prefix(kRigs.size());
  return std::string(name.substr(0, name.find('/')));
}

// True if a grant gives the role on the rig of this name or, if the name is
// empty, on any rig.
bool Holds(const Caller& caller, Role role, const std::string& name) {
  const std::string rig = RigOf(name);
  return std::any_of(
      caller.grants.begin(), caller.grants.end(), [&](const Grant& grant) {
        if (grant.role < role) return false;
        const bool named = !rig.empty() && grant.rig == rig;
        return grant.rig.empty() || name.empty() || named;
      });
}

bool HoldsOnEveryRig(const Caller& caller, Role role) {
  return std::any_of(
      caller.grants.begin(), caller.grants.end(), [&](const Grant& grant) {
        return grant.role >= role && grant.rig.empty();
      });
}

bool Passes(const Caller& caller,
            const v1::AccessRule& rule,
            Role role,
            const Message& request) {
  if (rule.rig_field().empty()) return HoldsOnEveryRig(caller, role);
  return std::all_of(rule.rig_field().begin(),
                     rule.rig_field().end(),
                     [&](const std::string& field) {
                       const std::string name = TextAt(request, field);
                       return name.empty() && rule.empty_means_all()
                                  ? HoldsOnEveryRig(caller, role)
                                  : Holds(caller, role, name);
                     });
}

std::optional<Role> RoleOf(v1::AccessRule::Role role) {
  switch (role) {
    case v1::AccessRule::READ:
      return Role::kRead;
    case v1::AccessRule::PRODUCE:
      return Role::kProduce;
    case v1::AccessRule::ADMINISTER:
      return Role::kAdminister;
    default:
      return std::nullopt;
  }
}

}  // namespace

absl::Status Authorise(const Caller& caller,
                       const google::protobuf::MethodDescriptor& method,
                       const Message& request) {
  const v1::AccessRule& rule = method.options().GetExtension(v1::access);
  if (rule.role() == v1::AccessRule::ANYBODY) return absl::OkStatus();
  const std::optional<Role> role = RoleOf(rule.role());
  if (!role) {
    return absl::PermissionDeniedError(
        "nobody may call this method: it has no access rule");
  }
  if (Passes(caller, rule, *role, request)) return absl::OkStatus();
  std::string message = "this needs the role '";
  message += RoleName(*role);
  message += rule.rig_field().empty() ? "' on every rig" : "' on the rig";
  message += ", which '" + caller.name +
             "' does not have; ask the operator for a certificate that grants "
             "it";
  return absl::PermissionDeniedError(message);
}

std::string RigOf(const google::protobuf::MethodDescriptor& method,
                  const Message& request) {
  const v1::AccessRule& rule = method.options().GetExtension(v1::access);
  if (rule.rig_field_size() != 1) return "";
  return RigOf(TextAt(request, rule.rig_field(0)));
}

}  // namespace selfcal::server
