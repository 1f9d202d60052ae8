#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "server/encode/encode.h"
#include "server/encode/versions.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/service/watch.h"

namespace selfcal::server {
namespace {

constexpr char kType[] = "selfcal.v1.Recalibration";

bool HasEnded(RunState state) {
  return state == RunState::kSucceeded || state == RunState::kFailed ||
         state == RunState::kCancelled;
}

struct RunId {
  std::string rig;
  std::int64_t run;
};

grpc::Status ParseRun(const std::string& name, RunId* id) {
  const auto parts = ParseChildName(name, "recalibrations");
  const auto run = parts ? ParseCount(parts->id) : std::nullopt;
  if (!run) return BadName("name", "rigs/{rig}/recalibrations/{run}");
  *id = {parts->rig, *run};
  return grpc::Status::OK;
}

class RecalibrationService final : public v1::RecalibrationService::Service {
 public:
  explicit RecalibrationService(const ServiceContext& context)
      : context_(context) {}

  grpc::Status StartRecalibration(grpc::ServerContext* call,
                                  const v1::StartRecalibrationRequest* request,
                                  v1::Recalibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      const auto run =
          context_.pipeline->StartRecalibration(*rig, request->force());
      if (!run.ok()) {
        return ToGrpc(run.status(),
                      {"selfcal.v1.Rig", request->parent(), "parent"});
      }
      return EncodeWithReport(*run, {}, response);
    });
  }

  grpc::Status GetRecalibration(grpc::ServerContext* call,
                                const v1::GetRecalibrationRequest* request,
                                v1::Recalibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      RunId id;
      if (auto bad = ParseRun(request->name(), &id); !bad.ok()) return bad;
      const auto run = context_.store->GetRun(id.rig, id.run);
      if (!run.ok()) {
        return ToGrpc(run.status(), {kType, request->name(), {}});
      }
      return EncodeWithReport(*run, {}, response);
    });
  }

  grpc::Status ListRecalibrations(
      grpc::ServerContext* call,
      const v1::ListRecalibrationsRequest* request,
      v1::ListRecalibrationsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      return FillPage(
          *request,
          request->parent(),
          [&](const Page& page) {
            return context_.store->ListRuns(*rig, page);
          },
          [this](const StoredRun& run, v1::ListRecalibrationsResponse* to) {
            return EncodeWithReport(run, {}, to->add_recalibrations());
          },
          response);
    });
  }

  grpc::Status WatchRecalibration(
      grpc::ServerContext* call,
      const v1::WatchRecalibrationRequest* request,
      grpc::ServerWriter<v1::Recalibration>* writer) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      RunId id;
      if (auto bad = ParseRun(request->name(), &id); !bad.ok()) return bad;
      // Declared before the subscription, so that it outlives it.
      Mailbox<RunUpdate> mailbox;
      const auto subscription = context_.pipeline->WatchRun(
          id.rig, id.run, [&](const RunUpdate& update) {
            mailbox.Put(update);
          });
      if (!subscription.ok()) {
        return ToGrpc(subscription.status(), {kType, request->name(), "name"});
      }
      grpc::Status encoded;
      const grpc::Status watched = Watch(
          context_, call, &mailbox, [&](const RunUpdate& update, bool* done) {
            v1::Recalibration message;
            encoded = EncodeWithReport(update.run, update.progress, &message);
            *done = HasEnded(update.run.state);
            return encoded.ok() && writer->Write(message);
          });
      return encoded.ok() ? watched : encoded;
    });
  }

  grpc::Status CancelRecalibration(
      grpc::ServerContext* call,
      const v1::CancelRecalibrationRequest* request,
      v1::Recalibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      RunId id;
      if (auto bad = ParseRun(request->name(), &id); !bad.ok()) return bad;
      const auto run = context_.pipeline->CancelRecalibration(id.rig, id.run);
      if (!run.ok()) {
        return ToGrpc(run.status(), {kType, request->name(), {}});
      }
      return EncodeWithReport(*run, {}, response);
    });
  }

 private:
  grpc::Status EncodeWithReport(const StoredRun& run,
                                const CalibrateProgress& progress,
                                v1::Recalibration* message) {
    auto encoded = server::EncodeWithReport(context_.store, run, progress);
    if (!encoded.ok()) return ToGrpc(encoded.status(), {});
    *message = *std::move(encoded);
    return grpc::Status::OK;
  }

  ServiceContext context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeRecalibrationService(
    const ServiceContext& context) {
  return std::make_unique<RecalibrationService>(context);
}

}  // namespace selfcal::server
