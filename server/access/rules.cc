#include "server/access/rules.h"

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "selfcal/v1/access.pb.h"

namespace selfcal::server {
namespace {

using google::protobuf::Message;

constexpr std::string_view kRigs = "rigs/";

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
  if (!name.starts_with(kRigs)) return "";
  name.remove_prefix(kRigs.size());
  return std::string(name.substr(0, name.find('/')));
}

using Labels = std::map<std::string, std::string>;

// The labels at this path, a map of strings.
Labels LabelsAt(const Message& message, std::string_view path) {
  const std::size_t dot = path.find('.');
  const auto* field = message.GetDescriptor()->FindFieldByName(
      std::string(path.substr(0, dot)));
  if (field == nullptr) return {};
  const auto& reflection = *message.GetReflection();
  if (dot != path.npos) {
    return LabelsAt(reflection.GetMessage(message, field),
                    path.substr(dot + 1));
  }
  Labels labels;
  for (int k = 0; k < reflection.FieldSize(message, field); ++k) {
    const Message& entry = reflection.GetRepeatedMessage(message, field, k);
    labels[TextAt(entry, "key")] = TextAt(entry, "value");
  }
  return labels;
}

// True if these rights are on the rig of this name.
absl::StatusOr<bool> IncludeNamed(const RigRights& rights,
                                  const std::string& name,
                                  const v1::AccessRule& rule,
                                  const Message& request,
                                  const LabelsOf& labels_of) {
  const std::string rig = RigOf(name);
  if (rig.empty()) return false;
  if (rights.rigs.contains(rig)) return true;
  if (rights.labels.empty()) return false;
  if (!rule.labels_field().empty()) {
    return Include(rights, rig, LabelsAt(request, rule.labels_field()));
  }
  const auto labels = labels_of(rig);
  if (absl::IsNotFound(labels.status())) return false;
  if (!labels.ok()) return labels.status();
  return Include(rights, rig, *labels);
}

absl::StatusOr<bool> Passes(const Caller& caller,
                            const v1::AccessRule& rule,
                            Role role,
                            const Message& request,
                            const LabelsOf& labels_of,
                            const std::string& rig_of_stream) {
  const std::optional<RigRights> rights = RightsOf(caller, role);
  if (!rights) return true;  // on every rig
  if (rights->empty()) return false;
  if (rule.rig_field().empty()) return rule.limited_to_rights();
  for (const std::string& field : rule.rig_field()) {
    std::string name = TextAt(request, field);
    if (name.empty() && !rig_of_stream.empty()) {
      name = std::string(kRigs) + rig_of_stream;
    }
    if (name.empty()) continue;
    const auto includes = IncludeNamed(*rights, name, rule, request, labels_of);
    if (!includes.ok() || !*includes) return includes;
  }
  return true;
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
                       const Message& request,
                       const LabelsOf& labels_of,
                       const std::string& rig_of_stream) {
  const v1::AccessRule& rule = method.options().GetExtension(v1::access);
  if (rule.role() == v1::AccessRule::ANYBODY) return absl::OkStatus();
  const std::optional<Role> role = RoleOf(rule.role());
  if (!role) {
    return absl::PermissionDeniedError(
        "nobody may call this method: it has no access rule");
  }
  const auto passes =
      Passes(caller, rule, *role, request, labels_of, rig_of_stream);
  if (!passes.ok()) return passes.status();
  if (*passes) return absl::OkStatus();
  std::string message = "this needs the role '";
  message += RoleName(*role);
  if (rule.limited_to_rights() && rule.rig_field().empty()) {
    message += "' on some rig";
  } else {
    message += rule.rig_field().empty() ? "' on every rig" : "' on the rig";
  }
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
