#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "server/encode/compare.h"
#include "server/encode/encode.h"
#include "server/encode/encode_coaching.h"
#include "server/encode/encode_verification.h"
#include "server/encode/reason.h"
#include "server/encode/versions.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/service/watch.h"

namespace selfcal::server {
namespace {

constexpr char kType[] = "selfcal.v1.Calibration";
constexpr int kDefaultAdvice = 3;

class CalibrationService final : public v1::CalibrationService::Service {
 public:
  explicit CalibrationService(const ServiceContext& context)
      : context_(context) {}

  grpc::Status GetCalibration(grpc::ServerContext* call,
                              const v1::GetCalibrationRequest* request,
                              v1::Calibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      StoredCalibration calibration;
      const auto status = Read("name", request->name(), &calibration);
      return status.ok() ? Fill(calibration, request->name(), response)
                         : status;
    });
  }

  grpc::Status ActivateCalibration(
      grpc::ServerContext* call,
      const v1::ActivateCalibrationRequest* request,
      v1::Calibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto parts = ParseChildName(request->name(), "calibrations");
      const auto version = parts ? ParseCount(parts->id) : std::nullopt;
      if (!version) return BadName("name", "rigs/{rig}/calibrations/{version}");
      const std::string& reason = request->reason();
      if (!IsReason(reason)) {
        return InvalidFields({{"reason", std::string(kReasonRule)}});
      }
      const auto active = context_.pipeline->ActivateCalibration(
          parts->rig, *version, CallerName(*call), reason);
      if (!active.ok()) {
        return ToGrpc(active.status(), {kType, request->name(), "name"});
      }
      return Fill(*active, request->name(), response);
    });
  }

  grpc::Status CompareCalibrations(
      grpc::ServerContext* call,
      const v1::CompareCalibrationsRequest* request,
      v1::CompareCalibrationsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      StoredCalibration a;
      StoredCalibration b;
      if (auto bad = Read("a", request->a(), &a); !bad.ok()) return bad;
      if (auto bad = Read("b", request->b(), &b); !bad.ok()) return bad;
      if (a.rig != b.rig) {
        return InvalidFields({{"b", "must be a version of the rig of a"}});
      }
      const auto compared = Compare(context_.store, a, b);
      if (!compared.ok()) {
        return ToGrpc(compared.status(), {kType, request->a(), "a"});
      }
      *response = *compared;
      return grpc::Status::OK;
    });
  }

  grpc::Status AdviseMotion(grpc::ServerContext* call,
                            const v1::AdviseMotionRequest* request,
                            v1::AdviseMotionResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      if (request->max_advice() < 0) {
        return InvalidFields({{"max_advice", "must be 0 or more"}});
      }
      const auto coaching = context_.pipeline->AdviseMotion(*rig);
      if (!coaching.ok()) {
        return ToGrpc(coaching.status(),
                      {"selfcal.v1.Rig", request->parent(), "parent"});
      }
      *response = Encode(
          *coaching,
          request->max_advice() > 0 ? request->max_advice() : kDefaultAdvice);
      return grpc::Status::OK;
    });
  }

  grpc::Status VerifyRig(
      grpc::ServerContext* call,
      const v1::VerifyRigRequest* request,
      grpc::ServerWriter<v1::VerifyRigResponse>* writer) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      const auto verification = context_.pipeline->VerifyRig(
          *rig,
          [&](const VerificationStep& step) {
            writer->Write(Encode(*rig, step));
          },
          [&] { return call->IsCancelled() || context_.stopping->load(); });
      if (context_.stopping->load()) return ShuttingDown();
      if (!verification.ok()) {
        return ToGrpc(verification.status(),
                      {"selfcal.v1.Rig", request->parent(), "parent"});
      }
      writer->Write(Encode(*verification));
      return grpc::Status::OK;
    });
  }

  grpc::Status ListCalibrations(
      grpc::ServerContext* call,
      const v1::ListCalibrationsRequest* request,
      v1::ListCalibrationsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      return FillPage(
          *request,
          request->parent(),
          [&](const Page& page) {
            return context_.store->ListCalibrations(*rig, page);
          },
          [&](const StoredCalibration& calibration,
              v1::ListCalibrationsResponse* to) {
            return Fill(calibration, request->parent(), to->add_calibrations());
          },
          response);
    });
  }

  grpc::Status WatchCalibration(
      grpc::ServerContext* call,
      const v1::WatchCalibrationRequest* request,
      grpc::ServerWriter<v1::Calibration>* writer) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      // Declared before the subscription, so that it outlives it.
      Mailbox<StoredCalibration> mailbox;
      const auto subscription = context_.pipeline->WatchCalibration(
          *rig, [&](const StoredCalibration& active) { mailbox.Put(active); });
      if (!subscription.ok()) {
        return ToGrpc(subscription.status(),
                      {"selfcal.v1.Rig", request->parent(), "parent"});
      }
      // The version that the client has. If it was rolled back and activated
      // again while the client was slow, it is not sent again.
      std::int64_t sent = 0;
      return Watch(context_,
                   call,
                   &mailbox,
                   [&](const StoredCalibration& active, bool*) {
                     if (active.version == sent) return true;
                     sent = active.version;
                     v1::Calibration message;
                     return Fill(active, request->parent(), &message).ok() &&
                            writer->Write(message);
                   });
    });
  }

 private:
  grpc::Status Fill(const StoredCalibration& calibration,
                    const std::string& name,
                    v1::Calibration* message) {
    auto encoded = Encode(context_.store, calibration);
    if (!encoded.ok()) return ToGrpc(encoded.status(), {kType, name, {}});
    *message = *std::move(encoded);
    return grpc::Status::OK;
  }

  // Reads the version of that name.
  grpc::Status Read(std::string_view field,
                    const std::string& name,
                    StoredCalibration* calibration) {
    constexpr char kPattern[] =
        "rigs/{rig}/calibrations/{version}, {version} a number or 'active'";
    const auto parts = ParseChildName(name, "calibrations");
    if (!parts) return BadName(field, kPattern);
    const bool active = parts->id == "active";
    const auto version = ParseCount(parts->id);
    if (!active && !version) return BadName(field, kPattern);
    auto read = active ? context_.store->GetActiveCalibration(parts->rig)
                       : context_.store->GetCalibration(parts->rig, *version);
    if (!read.ok()) return ToGrpc(read.status(), {kType, name, {}});
    *calibration = *std::move(read);
    return grpc::Status::OK;
  }

  ServiceContext context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCalibrationService(
    const ServiceContext& context) {
  return std::make_unique<CalibrationService>(context);
}

}  // namespace selfcal::server
