#include <google/protobuf/empty.pb.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.pb.h"
#include "server/api/errors.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/read_rig_query.h"
#include "server/api/rig_watches.h"
#include "server/encode/encode.h"
#include "server/encode/labels.h"
#include "server/encode/reason.h"
#include "server/status/status_macros.h"
#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

enum class Age { kNew, kExisting };

// The rig of a request, checked; fields are named below "rig.". A new one gets
// the optional blocks that it estimates.
absl::StatusOr<StoredRig> ReadRig(const v1::Rig& message, Age age) {
  StoredRig stored;
  Rig& rig = stored.rig;
  auto violations = FromProto(message, "rig.", &rig);
  if (!violations.empty()) return InvalidFields(violations);
  if (age == Age::kNew) {
    AddEstimatedBlocks(rig.blocks, &rig.factory);
    if (rig.prior_mean) AddEstimatedBlocks(rig.blocks, &*rig.prior_mean);
    if (message.groups().empty()) {
      rig.groups = DefaultGroups(rig.blocks, rig.factory);
    }
  }
  violations = Validate(stored.rig);
  for (Violation& violation : violations) {
    violation.field = "rig." + RigFieldPath(violation.field);
  }
  for (const auto& more : {GetPolicy(message, &stored.policy),
                           GetLabels(message, &stored.labels)}) {
    for (const Violation& violation : more) {
      violations.push_back({"rig." + violation.field, violation.message});
    }
  }
  if (!violations.empty()) return InvalidFields(violations);
  for (const Violation& violation :
       Validate(stored.rig, stored.policy.walk_densities)) {
    violations.push_back({"rig." + violation.field, violation.message});
  }
  if (!violations.empty()) return InvalidFields(violations);
  return stored;
}

absl::StatusOr<v1::Rig> CreateRig(const ApiContext& context,
                                  const Call&,
                                  const v1::CreateRigRequest& request) {
  if (!request.has_rig()) return InvalidFields({{"rig", "is missing"}});
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           ReadRig(request.rig(), Age::kNew));
  const auto created = context.domain->CreateRig(rig);
  if (!created.ok()) {
    return About(created.status(), {kRigType, request.rig().name(), "rig"});
  }
  return Encode(*created);
}

// Why a field of a rig cannot change; empty if it can.
std::string WhyNot(const std::string& field) {
  const std::string kStored =
      "cannot change: what is stored was computed with it; create another rig";
  if (field == "name") return "cannot change: it is the identity of the rig";
  if (field == "create_time") return "cannot change: it is set by the daemon";
  if (field == "factory") {
    return "cannot change: it is version 1, and versions never change";
  }
  for (const char* const fixed : {"imu_noise",
                                  "imu1_noise",
                                  "pixel_sigma_px",
                                  "gravity_mps2",
                                  "groups",
                                  "fixed",
                                  "table_size",
                                  "selection",
                                  "estimate_time_offset",
                                  "blocks"}) {
    if (field == fixed) return kStored;
  }
  return v1::Rig::descriptor()->FindFieldByName(field) == nullptr
             ? "is not a field of a rig"
             : "";
}

// The fields of the mask or, if it is empty, those that can change and are set.
absl::StatusOr<std::vector<std::string>> FieldsToUpdate(
    const v1::UpdateRigRequest& request) {
  std::vector<std::string> fields;
  if (request.update_mask().paths().empty()) {
    std::vector<const google::protobuf::FieldDescriptor*> set;
    request.rig().GetReflection()->ListFields(request.rig(), &set);
    for (const auto* field : set) {
      if (WhyNot(field->name()).empty()) fields.push_back(field->name());
    }
    return fields;
  }
  std::vector<Violation> violations;
  for (const std::string& path : request.update_mask().paths()) {
    const std::string why = WhyNot(path);
    if (why.empty()) {
      fields.push_back(path);
    } else {
      violations.push_back({"update_mask." + path, why});
    }
  }
  if (!violations.empty()) return InvalidFields(violations);
  return fields;
}

absl::StatusOr<v1::Rig> UpdateRig(const ApiContext& context,
                                  const Call& call,
                                  const v1::UpdateRigRequest& request) {
  const auto id = ParseRigName(request.rig().name());
  if (!id) return BadName("rig.name", "rigs/{rig}");
  if (!request.reason().empty() && !IsReason(request.reason())) {
    return InvalidFields({{"reason", std::string(kReasonRule)}});
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> fields,
                           FieldsToUpdate(request));
  const auto change =
      [&](const StoredRig& before) -> absl::StatusOr<StoredRig> {
    v1::Rig rig = Encode(before);
    // What the request sets of the fields, in place of what there was.
    v1::Rig set = request.rig();
    for (int k = 0; k < v1::Rig::descriptor()->field_count(); ++k) {
      const auto* field = v1::Rig::descriptor()->field(k);
      const bool chosen =
          std::find(fields.begin(), fields.end(), field->name()) !=
          fields.end();
      v1::Rig* other = chosen ? &rig : &set;
      other->GetReflection()->ClearField(other, field);
    }
    rig.MergeFrom(set);
    return ReadRig(rig, Age::kExisting);
  };
  const auto updated = context.pipeline->UpdateRig(
      *id, change, call.caller.name, request.reason());
  if (!updated.ok()) {
    return About(updated.status(), {kRigType, request.rig().name(), {}});
  }
  return Encode(*updated);
}

absl::StatusOr<google::protobuf::Empty> DeleteRig(
    const ApiContext& context,
    const Call& call,
    const v1::DeleteRigRequest& request) {
  const auto id = ParseRigName(request.name());
  if (!id) return BadName("name", "rigs/{rig}");
  if (!IsReason(request.reason())) {
    return InvalidFields({{"reason", std::string(kReasonRule)}});
  }
  const absl::Status deleted =
      context.pipeline->DeleteRig(*id, call.caller.name, request.reason());
  if (!deleted.ok()) return About(deleted, {kRigType, request.name(), {}});
  context.watches->End(*id);
  return google::protobuf::Empty();
}

absl::StatusOr<v1::Rig> GetRig(const ApiContext& context,
                               const Call&,
                               const v1::GetRigRequest& request) {
  const auto id = ParseRigName(request.name());
  if (!id) return BadName("name", "rigs/{rig}");
  const auto rig = context.store->GetRig(*id);
  if (!rig.ok()) return About(rig.status(), {kRigType, request.name(), {}});
  return Encode(*rig);
}

absl::StatusOr<v1::ListRigsResponse> ListRigs(
    const ApiContext& context,
    const Call& call,
    const v1::ListRigsRequest& request) {
  RigQuery query;
  SELFCAL_RETURN_IF_ERROR(
      ReadRigQuery(call, request.filter(), request.order_by(), &query));
  return FillPage<v1::ListRigsResponse>(
      request,
      "",
      [&](const Page& page) { return context.store->ListRigs(query, page); },
      [](const StoredRig& rig, v1::ListRigsResponse* to) {
        *to->add_rigs() = Encode(rig);
        return absl::OkStatus();
      });
}

}  // namespace

void AddRigMethods(Methods* methods) {
  methods->Add(CreateRig);
  methods->Add(GetRig);
  methods->Add(ListRigs);
  methods->Add(UpdateRig);
  methods->Add(DeleteRig);
}

}  // namespace selfcal::server
