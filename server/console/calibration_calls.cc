#include <google/protobuf/util/json_util.h>

#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "server/console/asked.h"
#include "server/encode/compare.h"
#include "server/encode/encode.h"
#include "server/encode/encode_coaching.h"
#include "server/encode/reason.h"
#include "server/encode/versions.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::string_view kActivate = ":activate";

}  // namespace

absl::StatusOr<StoredCalibration> ReadVersion(const Call& call,
                                              const std::string& id) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  if (id == "active") return call.context.store->GetActiveCalibration(rig);
  const auto version = ParseCount(id);
  if (version) return call.context.store->GetCalibration(rig, *version);
  return absl::InvalidArgumentError(
      "a version must be a number >= 1, or 'active'");
}

Answer ListCalibrations(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListCalibrationsRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<v1::ListCalibrationsResponse>(
      call.context.store->ListCalibrations(rig, page),
      [&](const StoredCalibration& calibration,
          auto* response) -> absl::Status {
        SELFCAL_ASSIGN_OR_RETURN(*response->add_calibrations(),
                                 Encode(call.context.store, calibration));
        return absl::OkStatus();
      });
}

Answer GetCalibration(const Call& call) {
  v1::GetCalibrationRequest request;
  request.set_name(
      ChildName(call.parts.at(0), "calibrations", call.parts.at(1)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration calibration,
                           ReadVersion(call, call.parts[1]));
  SELFCAL_ASSIGN_OR_RETURN(const v1::Calibration message,
                           Encode(call.context.store, calibration));
  return JsonResponse(message);
}

// The body is an ActivateCalibrationRequest; the address has the version.
Answer ActivateCalibration(const Call& call) {
  std::string id = call.parts.at(1);
  if (!id.ends_with(kActivate)) {
    return absl::UnimplementedError(
        "a version can be read with GET, and with POST ':activate' be made "
        "active");
  }
  id.resize(id.size() - kActivate.size());
  v1::ActivateCalibrationRequest request;
  const auto parsed =
      google::protobuf::util::JsonStringToMessage(call.request.body, &request);
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(
        "the body must be JSON such as {\"reason\": \"...\"}");
  }
  request.set_name(ChildName(call.parts[0], "calibrations", id));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  const auto version = ParseCount(id);
  if (!version) {
    return absl::InvalidArgumentError("a version must be a number >= 1");
  }
  if (!IsReason(request.reason())) {
    return absl::InvalidArgumentError("reason: " + std::string(kReasonRule));
  }
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredCalibration active,
      call.context.pipeline->ActivateCalibration(
          rig, *version, call.request.caller.name, request.reason()));
  SELFCAL_ASSIGN_OR_RETURN(const v1::Calibration message,
                           Encode(call.context.store, active));
  return JsonResponse(message);
}

// May take seconds at the first request about a version.
Answer AdviseMotion(const Call& call) {
  constexpr int kDefaultAdvice = 3;
  v1::AdviseMotionRequest request;
  request.set_parent(RigName(call.parts.at(0)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  SELFCAL_ASSIGN_OR_RETURN(
      const int max_advice,
      CountOf(call,
              "max_advice",
              kDefaultAdvice,
              "max_advice must be a number >= 1; without it 3 motions are "
              "returned"));
  SELFCAL_ASSIGN_OR_RETURN(const RigCoaching coaching,
                           call.context.pipeline->AdviseMotion(rig));
  return JsonResponse(Encode(coaching, max_advice));
}

Answer CompareCalibrations(const Call& call) {
  v1::CompareCalibrationsRequest request;
  request.set_a(ChildName(call.parts.at(0), "calibrations", call.Query("a")));
  request.set_b(ChildName(call.parts[0], "calibrations", call.Query("b")));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration a,
                           ReadVersion(call, call.Query("a")));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration b,
                           ReadVersion(call, call.Query("b")));
  SELFCAL_ASSIGN_OR_RETURN(const v1::CompareCalibrationsResponse compared,
                           Compare(call.context.store, a, b));
  return JsonResponse(compared);
}

}  // namespace selfcal::server
