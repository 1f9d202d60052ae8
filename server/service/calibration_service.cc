#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "server/service/caller.h"
#include "server/service/encode.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/service/versions.h"
#include "server/service/watch.h"

namespace selfcal::server {
namespace {

class CalibrationService final : public v1::CalibrationService::Service {
 public:
  explicit CalibrationService(const ServiceContext& context)
      : context_(context) {}

  grpc::Status GetCalibration(grpc::ServerContext* call,
                              const v1::GetCalibrationRequest* request,
                              v1::Calibration* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      constexpr char kPattern[] =
          "rigs/{rig}/calibrations/{version}, {version} a number or 'active'";
      const auto parts = ParseChildName(request->name(), "calibrations");
      if (!parts) return BadName("name", kPattern);
      const bool active = parts->id == "active";
      const auto version = ParseCount(parts->id);
      if (!active && !version) return BadName("name", kPattern);
      const auto calibration =
          active ? context_.store->GetActiveCalibration(parts->rig)
                 : context_.store->GetCalibration(parts->rig, *version);
      if (!calibration.ok()) {
        return ToGrpc(calibration.status(),
                      {"selfcal.v1.Calibration", request->name(), {}});
      }
      *response = Encode(*calibration);
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
          [](const StoredCalibration& calibration,
             v1::ListCalibrationsResponse* to) {
            *to->add_calibrations() = Encode(calibration);
            return grpc::Status::OK;
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
      // Before the subscription, so that it ends after it.
      Mailbox<StoredCalibration> mailbox;
      const auto subscription = context_.pipeline->WatchCalibration(
          *rig, [&](const StoredCalibration& active) { mailbox.Put(active); });
      if (!subscription.ok()) {
        return ToGrpc(subscription.status(),
                      {"selfcal.v1.Rig", request->parent(), "parent"});
      }
      return Watch(context_,
                   call,
                   &mailbox,
                   [&](const StoredCalibration& active, bool*) {
                     return writer->Write(Encode(active));
                   });
    });
  }

 private:
  ServiceContext context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCalibrationService(
    const ServiceContext& context) {
  return std::make_unique<CalibrationService>(context);
}

}  // namespace selfcal::server
