#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.pb.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/encode/encode.h"
#include "server/store/rig_policy.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

constexpr char kType[] = "selfcal.v1.Rig";

absl::StatusOr<v1::Rig> CreateRig(const ApiContext& context,
                                  const Call&,
                                  const v1::CreateRigRequest& request) {
  if (!request.has_rig()) return InvalidFields({{"rig", "is missing"}});
  Rig rig;
  auto violations = FromProto(request.rig(), "rig.", &rig);
  if (!violations.empty()) return InvalidFields(violations);
  violations = Validate(rig);
  for (Violation& violation : violations) {
    violation.field = "rig." + RigFieldPath(violation.field);
  }
  RigPolicy policy;
  for (const Violation& violation : GetPolicy(request.rig(), &policy)) {
    violations.push_back({"rig." + violation.field, violation.message});
  }
  if (!violations.empty()) return InvalidFields(violations);
  for (const Violation& violation : Validate(rig, policy.walk_densities)) {
    violations.push_back({"rig." + violation.field, violation.message});
  }
  if (!violations.empty()) return InvalidFields(violations);
  const auto created = context.domain->CreateRig(rig, policy);
  if (!created.ok()) {
    return About(created.status(), {kType, request.rig().name(), "rig"});
  }
  return Encode(*created);
}

absl::StatusOr<v1::Rig> GetRig(const ApiContext& context,
                               const Call&,
                               const v1::GetRigRequest& request) {
  const auto id = ParseRigName(request.name());
  if (!id) return BadName("name", "rigs/{rig}");
  const auto rig = context.store->GetRig(*id);
  if (!rig.ok()) return About(rig.status(), {kType, request.name(), {}});
  return Encode(*rig);
}

absl::StatusOr<v1::ListRigsResponse> ListRigs(
    const ApiContext& context,
    const Call&,
    const v1::ListRigsRequest& request) {
  return FillPage<v1::ListRigsResponse>(
      request,
      "",
      [&](const Page& page) { return context.store->ListRigs(page); },
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
}

}  // namespace selfcal::server
