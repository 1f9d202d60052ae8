#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "server/service/encode.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

constexpr char kType[] = "selfcal.v1.Rig";

class RigService final : public v1::RigService::Service {
 public:
  explicit RigService(const ServiceContext& context) : store_(context.store) {}

  grpc::Status CreateRig(grpc::ServerContext*,
                         const v1::CreateRigRequest* request,
                         v1::Rig* response) override {
    return Guarded([&] { return Create(*request, response); });
  }

  grpc::Status GetRig(grpc::ServerContext*,
                      const v1::GetRigRequest* request,
                      v1::Rig* response) override {
    return Guarded([&]() -> grpc::Status {
      const auto id = ParseRigName(request->name());
      if (!id) return BadName("name", "rigs/{rig}");
      const auto rig = store_->GetRig(*id);
      if (!rig.ok()) return ToGrpc(rig.status(), {kType, request->name(), {}});
      *response = Encode(*rig);
      return grpc::Status::OK;
    });
  }

  grpc::Status ListRigs(grpc::ServerContext*,
                        const v1::ListRigsRequest* request,
                        v1::ListRigsResponse* response) override {
    return Guarded([&] {
      return FillPage(
          *request,
          "",
          [&](const Page& page) { return store_->ListRigs(page); },
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
    const auto created = store_->CreateRig(rig, policy);
    if (!created.ok()) {
      return ToGrpc(created.status(), {kType, request.rig().name(), "rig"});
    }
    *response = Encode(*created);
    return grpc::Status::OK;
  }

  Store* store_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeRigService(const ServiceContext& context) {
  return std::make_unique<RigService>(context);
}

}  // namespace selfcal::server
