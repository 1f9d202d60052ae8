#include <cstdint>
#include <mutex>
#include <optional>

#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "server/encode/encode.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

constexpr char kType[] = "selfcal.v1.Rig";

class RigService final : public v1::RigService::Service {
 public:
  explicit RigService(const ServiceContext& context) : context_(context) {}

  grpc::Status CreateRig(grpc::ServerContext* call,
                         const v1::CreateRigRequest* request,
                         v1::Rig* response) override {
    return Authorised(
        context_, *call, *request, [&] { return Create(*request, response); });
  }

  grpc::Status GetRig(grpc::ServerContext* call,
                      const v1::GetRigRequest* request,
                      v1::Rig* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto id = ParseRigName(request->name());
      if (!id) return BadName("name", "rigs/{rig}");
      const auto rig = context_.store->GetRig(*id);
      if (!rig.ok()) return ToGrpc(rig.status(), {kType, request->name(), {}});
      *response = Encode(*rig);
      return grpc::Status::OK;
    });
  }

  grpc::Status ListRigs(grpc::ServerContext* call,
                        const v1::ListRigsRequest* request,
                        v1::ListRigsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      return FillPage(
          *request,
          "",
          [&](const Page& page) { return context_.store->ListRigs(page); },
          [](const StoredRig& rig, v1::ListRigsResponse* to) {
            *to->add_rigs() = Encode(rig);
            return grpc::Status::OK;
          },
          response);
    });
  }

 private:
  grpc::Status Create(const v1::CreateRigRequest& request, v1::Rig* response) {
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
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<std::int64_t> rigs = Count();
    if (!rigs.ok()) return ToGrpc(rigs.status(), {});
    const bool exists = context_.store->GetRig(rig.id).ok();
    if (*rigs >= context_.max_rigs && !exists) {
      return ToGrpc(absl::ResourceExhaustedError(
                        "the limit of rigs, the setting max-rigs, is reached; "
                        "ask the operator to raise it"),
                    {});
    }
    const auto created = context_.domain->CreateRig(rig, policy);
    if (!created.ok()) {
      return ToGrpc(created.status(), {kType, request.rig().name(), "rig"});
    }
    ++*rigs_;
    *response = Encode(*created);
    return grpc::Status::OK;
  }

  // Returns the number of rigs. It is read once and then kept up to date,
  // because rigs are never removed.
  absl::StatusOr<std::int64_t> Count() {
    if (rigs_) return *rigs_;
    std::int64_t rigs = 0;
    Page page{kMaxPageSize, ""};
    do {
      const auto listed = context_.store->ListRigs(page);
      if (!listed.ok()) return listed.status();
      rigs += static_cast<std::int64_t>(listed->items.size());
      page.token = listed->next_token;
    } while (!page.token.empty());
    rigs_ = rigs;
    return rigs;
  }

  ServiceContext context_;
  std::mutex mutex_;  // guards rigs_, and serialises the creation of rigs
  std::optional<std::int64_t> rigs_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeRigService(const ServiceContext& context) {
  return std::make_unique<RigService>(context);
}

}  // namespace selfcal::server
