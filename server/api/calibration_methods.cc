#include <functional>
#include <map>
#include <set>
#include <utility>

#include "core/model/temperature.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "server/api/errors.h"
#include "server/api/list_parent.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/read_version.h"
#include "server/api/version_updates.h"
#include "server/encode/calibration_filter.h"
#include "server/encode/compare.h"
#include "server/encode/encode.h"
#include "server/encode/encode_coaching.h"
#include "server/encode/encode_verification.h"
#include "server/encode/reason.h"
#include "server/encode/versions.h"
#include "server/pipeline/verdict.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kDefaultAdvice = 3;

absl::StatusOr<v1::Calibration> EncodeNamed(
    const ApiContext& context,
    const StoredCalibration& calibration,
    const std::string& name) {
  auto encoded = Encode(context.store, calibration);
  if (!encoded.ok())
    return About(encoded.status(), {kCalibrationType, name, {}});
  return encoded;
}

absl::StatusOr<v1::Calibration> EncodeAt(const ApiContext& context,
                                         const StoredCalibration& calibration,
                                         const std::string& name,
                                         double temperature_c) {
  const std::string fault = TemperatureFault(calibration.theta, temperature_c);
  if (!fault.empty()) return InvalidFields({{"temperature_c", fault}});
  if (!HasSlopes(calibration.theta)) {
    return EncodeNamed(context, calibration, name);
  }
  auto rig = context.store->GetRig(calibration.rig);
  if (!rig.ok()) return About(rig.status(), {kCalibrationType, name, {}});
  const CalibrationAtTemperature at =
      AtTemperature(calibration, *std::move(rig), temperature_c);
  v1::Calibration message = Encode(at.calibration, at.rig);
  message.set_temperature_c(temperature_c);
  return message;
}

absl::StatusOr<v1::Calibration> GetCalibration(
    const ApiContext& context,
    const Call&,
    const v1::GetCalibrationRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration calibration,
                           ReadVersion(context.store, "name", request.name()));
  if (request.has_temperature_c()) {
    return EncodeAt(
        context, calibration, request.name(), request.temperature_c());
  }
  return EncodeNamed(context, calibration, request.name());
}

absl::StatusOr<v1::Calibration> ActivateCalibration(
    const ApiContext& context,
    const Call& call,
    const v1::ActivateCalibrationRequest& request) {
  const auto parts = ParseChildName(request.name(), "calibrations");
  const auto version = parts ? ParseCount(parts->id) : std::nullopt;
  if (!version) return BadName("name", "rigs/{rig}/calibrations/{version}");
  if (!IsReason(request.reason())) {
    return InvalidFields({{"reason", std::string(kReasonRule)}});
  }
  const auto active = context.pipeline->ActivateCalibration(
      parts->rig, *version, call.caller.name, request.reason());
  if (!active.ok()) {
    return About(active.status(), {kCalibrationType, request.name(), "name"});
  }
  return EncodeNamed(context, *active, request.name());
}

absl::StatusOr<v1::CompareCalibrationsResponse> CompareCalibrations(
    const ApiContext& context,
    const Call&,
    const v1::CompareCalibrationsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration a,
                           ReadVersion(context.store, "a", request.a()));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration b,
                           ReadVersion(context.store, "b", request.b()));
  if (a.rig != b.rig) {
    return InvalidFields({{"b", "must be a version of the rig of a"}});
  }
  auto compared = Compare(context.store, a, b);
  if (!compared.ok()) {
    return About(compared.status(), {kCalibrationType, request.a(), "a"});
  }
  return compared;
}

absl::StatusOr<v1::AdviseMotionResponse> AdviseMotion(
    const ApiContext& context,
    const Call&,
    const v1::AdviseMotionRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  if (request.max_advice() < 0) {
    return InvalidFields({{"max_advice", "must be 0 or more"}});
  }
  const auto coaching = context.pipeline->AdviseMotion(*rig);
  if (!coaching.ok()) {
    return About(coaching.status(), {kRigType, request.parent(), "parent"});
  }
  return Encode(
      *coaching,
      request.max_advice() > 0 ? request.max_advice() : kDefaultAdvice);
}

absl::Status VerifyRig(const ApiContext& context,
                       const Call& call,
                       const v1::VerifyRigRequest& request,
                       const Writer<v1::VerifyRigResponse>& write) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  const auto verification = context.pipeline->VerifyRig(
      *rig,
      [&](const VerificationStep& step) { write(Encode(*rig, step)); },
      [&] { return call.cancelled() || context.stopping->load(); });
  if (!verification.ok()) {
    return About(verification.status(), {kRigType, request.parent(), "parent"});
  }
  write(Encode(*verification));
  return absl::OkStatus();
}

// A covariance of 45 components is 17 kB in JSON: a page of so many versions is
// answered in 19 ms, one of 50 without the details in 24 (docs/fleet.md,
// Lists).
constexpr int kMaxDetailedVersions = 15;

using ListVersions = std::function<absl::StatusOr<Listed<StoredCalibration>>(
    const Page& page, CalibrationParts parts)>;

// ListCalibrationsRequest::BASIC. The definitions of the rigs are not needed.
absl::StatusOr<v1::ListCalibrationsResponse> ListSummaries(
    const v1::ListCalibrationsRequest& request, const ListVersions& list) {
  return FillPage<v1::ListCalibrationsResponse>(
      request,
      request.parent(),
      [&](const Page& page) { return list(page, CalibrationParts::kSummary); },
      [](const StoredCalibration& calibration,
         v1::ListCalibrationsResponse* to) {
        *to->add_calibrations() = EncodeSummary(calibration);
        return absl::OkStatus();
      });
}

absl::StatusOr<v1::ListCalibrationsResponse> ListWithDetails(
    Store* store,
    const v1::ListCalibrationsRequest& request,
    const ListVersions& list) {
  std::map<std::string, StoredRig> rigs;
  return FillPage<v1::ListCalibrationsResponse>(
      request,
      request.parent(),
      [&](const Page& page) -> absl::StatusOr<Listed<StoredCalibration>> {
        SELFCAL_ASSIGN_OR_RETURN(Listed<StoredCalibration> listed,
                                 list(page, CalibrationParts::kAll));
        std::set<std::string> names;
        for (const auto& item : listed.items) names.insert(item.rig);
        SELFCAL_ASSIGN_OR_RETURN(rigs, store->GetRigs(names));
        return listed;
      },
      [&](const StoredCalibration& calibration,
          v1::ListCalibrationsResponse* to) {
        // A rig may be deleted meanwhile.
        const auto rig = rigs.find(calibration.rig);
        if (rig == rigs.end()) return absl::OkStatus();
        *to->add_calibrations() = Encode(calibration, rig->second);
        return absl::OkStatus();
      },
      kMaxDetailedVersions);
}

absl::StatusOr<v1::ListCalibrationsResponse> ListCalibrations(
    const ApiContext& context,
    const Call& call,
    const v1::ListCalibrationsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(
      const ListParent parent,
      ReadListParent(call, request.parent(), request.rig_filter()));
  CalibrationQuery query;
  if (const auto filter = ParseCalibrationFilter(request.filter(), &query);
      !filter.ok()) {
    return About(filter, {kCalibrationType, "", "filter"});
  }
  if (const auto order = ParseCalibrationOrder(request.order_by(), &query);
      !order.ok()) {
    return About(order, {kCalibrationType, "", "order_by"});
  }
  const auto list = [&](const Page& page, CalibrationParts parts) {
    return context.store->ListCalibrations(
        parent.rig, query, page, parent.of, parts);
  };
  if (request.view() == v1::ListCalibrationsRequest::BASIC) {
    return ListSummaries(request, list);
  }
  return ListWithDetails(context.store, request, list);
}

absl::StatusOr<std::shared_ptr<void>> WatchCalibration(
    const ApiContext& context,
    const Call&,
    const v1::WatchCalibrationRequest& request,
    const Watch<v1::Calibration>& watch) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  // A version that was rolled back and became active again while the reader was
  // slow is the one that the reader has, unless its verdict is another one.
  auto sent = std::make_shared<std::pair<std::int64_t, VerdictKind>>();
  const Subject about{kCalibrationType, request.parent(), {}};
  auto subscription = context.pipeline->WatchCalibration(
      *rig, [=, &context](const auto& active) {
        watch.PutShared(
            "",
            [=,
             &context]() -> absl::StatusOr<std::shared_ptr<const WatchUpdate>> {
              const std::pair now(active->version, VerdictOf(*active).kind);
              if (std::exchange(*sent, now) == now) return nullptr;
              auto update = context.versions->Get(active);
              if (!update.ok()) return About(update.status(), about);
              return update;
            });
      });
  if (!subscription.ok()) {
    return About(subscription.status(), {kRigType, request.parent(), "parent"});
  }
  return std::shared_ptr<void>(*std::move(subscription));
}

}  // namespace

void AddCalibrationMethods(Methods* methods) {
  methods->Add(GetCalibration);
  methods->Add(ListCalibrations);
  methods->Add(WatchCalibration);
  methods->Add(ActivateCalibration);
  methods->Add(CompareCalibrations);
  methods->Add(AdviseMotion);
  methods->Add(VerifyRig);
}

}  // namespace selfcal::server
