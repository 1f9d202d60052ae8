#include "server/access/rules.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <string>

namespace selfcal::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FileDescriptor;
using google::protobuf::Message;

constexpr AccessRule kRules[] = {
    {"selfcal.v1.RigService.CreateRig", Role::kAdminister, "rig.name"},
    {"selfcal.v1.RigService.GetRig", Role::kRead, "name"},
    {"selfcal.v1.RigService.ListRigs", Role::kRead, ""},
    {"selfcal.v1.SegmentService.StreamSegments", Role::kProduce, "parent"},
    {"selfcal.v1.SegmentService.ListSegments", Role::kRead, "parent"},
    {"selfcal.v1.SegmentService.GetSegment", Role::kRead, "name"},
    {"selfcal.v1.SegmentService.GetSegmentData", Role::kRead, "name"},
    {"selfcal.v1.SegmentService.ListTables", Role::kRead, "parent"},
    {"selfcal.v1.SegmentService.GetTable", Role::kRead, "name"},
    {"selfcal.v1.SegmentService.QuarantineSegments",
     Role::kAdminister,
     "parent"},
    {"selfcal.v1.CalibrationService.GetCalibration", Role::kRead, "name"},
    {"selfcal.v1.CalibrationService.ListCalibrations", Role::kRead, "parent"},
    {"selfcal.v1.CalibrationService.WatchCalibration", Role::kRead, "parent"},
    {"selfcal.v1.CalibrationService.ActivateCalibration",
     Role::kAdminister,
     "name"},
    {"selfcal.v1.CalibrationService.CompareCalibrations", Role::kRead, "a,b"},
    {"selfcal.v1.CalibrationService.AdviseMotion", Role::kRead, "parent"},
    {"selfcal.v1.CalibrationService.VerifyRig", Role::kAdminister, "parent"},
    {"selfcal.v1.RecalibrationService.StartRecalibration",
     Role::kAdminister,
     "parent"},
    {"selfcal.v1.RecalibrationService.GetRecalibration", Role::kRead, "name"},
    {"selfcal.v1.RecalibrationService.ListRecalibrations",
     Role::kRead,
     "parent"},
    {"selfcal.v1.RecalibrationService.WatchRecalibration", Role::kRead, "name"},
    {"selfcal.v1.RecalibrationService.CancelRecalibration",
     Role::kAdminister,
     "name"},
    {"selfcal.v1.ActivityService.ListActivity", Role::kRead, ""},
    {"selfcal.v1.StoreService.CheckStore", Role::kAdminister, ""},
    {"selfcal.v1.StoreService.BackupStore", Role::kAdminister, ""},
    {"selfcal.v1.StoreService.RestoreStore", Role::kAdminister, ""},
    {"selfcal.v1.StoreService.ListEvents", Role::kRead, "parent", true},
};

// Finds the rule of a request: every method has its own request type, in the
// file of its service.
const AccessRule* RuleOf(const Descriptor& request) {
  const FileDescriptor& file = *request.file();
  for (int s = 0; s < file.service_count(); ++s) {
    for (int m = 0; m < file.service(s)->method_count(); ++m) {
      const auto& method = *file.service(s)->method(m);
      if (method.input_type() != &request) continue;
      const auto rule = std::find_if(
          std::begin(kRules), std::end(kRules), [&](const AccessRule& known) {
            return known.method == method.full_name();
          });
      return rule == std::end(kRules) ? nullptr : rule;
    }
  }
  return nullptr;
}

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
            const AccessRule& rule,
            const Message& request) {
  std::string_view fields = rule.rig_field;
  if (fields.empty()) return HoldsOnEveryRig(caller, rule.role);
  for (;;) {
    const std::size_t comma = fields.find(',');
    const std::string name = TextAt(request, fields.substr(0, comma));
    const bool every = name.empty() && rule.empty_is_every;
    if (!(every ? HoldsOnEveryRig(caller, rule.role)
                : Holds(caller, rule.role, name))) {
      return false;
    }
    if (comma == fields.npos) return true;
    fields.remove_prefix(comma + 1);
  }
}

}  // namespace

std::span<const AccessRule> AccessRules() { return kRules; }

absl::Status Authorise(const Caller& caller, const Message& request) {
  const AccessRule* rule = RuleOf(*request.GetDescriptor());
  if (rule == nullptr) {
    return absl::PermissionDeniedError(
        "nobody may call this method: it has no access rule");
  }
  if (Passes(caller, *rule, request)) return absl::OkStatus();
  std::string message = "this needs the role '";
  message += RoleName(rule->role);
  message += rule->rig_field.empty() ? "' on every rig" : "' on the rig";
  message += ", which '" + caller.name +
             "' does not have; ask the operator for a certificate that grants "
             "it";
  return absl::PermissionDeniedError(message);
}

}  // namespace selfcal::server
