#include <map>
#include <utility>
#include <vector>

#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.pb.h"
#include "server/api/errors.h"
#include "server/api/list_parent.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/encode/encode.h"
#include "server/encode/run_filter.h"
#include "server/encode/versions.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

bool HasEnded(RunState state) {
  return state == RunState::kSucceeded || state == RunState::kFailed ||
         state == RunState::kCancelled;
}

struct RunId {
  std::string rig;
  std::int64_t run = 0;
};

absl::StatusOr<RunId> ParseRun(const std::string& name) {
  const auto parts = ParseChildName(name, "recalibrations");
  const auto run = parts ? ParseCount(parts->id) : std::nullopt;
  if (!run) return BadName("name", "rigs/{rig}/recalibrations/{run}");
  return RunId{parts->rig, *run};
}

absl::StatusOr<v1::Recalibration> StartRecalibration(
    const ApiContext& context,
    const Call&,
    const v1::StartRecalibrationRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  const auto run = context.pipeline->StartRecalibration(*rig, request.force());
  if (!run.ok()) {
    return About(run.status(), {kRigType, request.parent(), "parent"});
  }
  return EncodeWithReport(context.store, *run, {});
}

absl::StatusOr<v1::Recalibration> GetRecalibration(
    const ApiContext& context,
    const Call&,
    const v1::GetRecalibrationRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const RunId id, ParseRun(request.name()));
  const auto run = context.store->GetRun(id.rig, id.run);
  if (!run.ok()) return About(run.status(), {kRunType, request.name(), {}});
  return EncodeWithConvergence(context.store, *run);
}

// The reports of the versions that the runs made, but damaged ones.
absl::StatusOr<std::map<VersionId, StoredCalibration>> ReportsOf(
    Store* store, const std::vector<StoredRun>& runs) {
  std::vector<VersionId> ids;
  for (const StoredRun& run : runs) {
    if (run.calibration_version != 0) {
      ids.emplace_back(run.rig, run.calibration_version);
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(std::vector<StoredCalibration> read,
                           store->GetReports(ids));
  std::map<VersionId, StoredCalibration> reports;
  for (StoredCalibration& report : read) {
    VersionId id(report.rig, report.version);
    reports.emplace(std::move(id), std::move(report));
  }
  return reports;
}

absl::StatusOr<v1::ListRecalibrationsResponse> ListRecalibrations(
    const ApiContext& context,
    const Call& call,
    const v1::ListRecalibrationsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(
      const ListParent parent,
      ReadListParent(call, request.parent(), request.rig_filter()));
  RunQuery query;
  if (const auto filter = ParseRunFilter(request.filter(), &query);
      !filter.ok()) {
    return About(filter, {kRunType, "", "filter"});
  }
  if (const auto order = ParseRunOrder(request.order_by(), &query);
      !order.ok()) {
    return About(order, {kRunType, "", "order_by"});
  }
  std::map<VersionId, StoredCalibration> reports;
  return FillPage<v1::ListRecalibrationsResponse>(
      request,
      request.parent(),
      [&](const Page& page) -> absl::StatusOr<Listed<StoredRun>> {
        SELFCAL_ASSIGN_OR_RETURN(
            Listed<StoredRun> listed,
            context.store->ListRuns(parent.rig, query, page, parent.of));
        SELFCAL_ASSIGN_OR_RETURN(reports,
                                 ReportsOf(context.store, listed.items));
        return listed;
      },
      [&](const StoredRun& run, v1::ListRecalibrationsResponse* to) {
        const auto report = reports.find({run.rig, run.calibration_version});
        *to->add_recalibrations() = Encode(
            run, {}, report == reports.end() ? nullptr : &report->second);
        return absl::OkStatus();
      });
}

absl::StatusOr<std::shared_ptr<void>> WatchRecalibration(
    const ApiContext& context,
    const Call&,
    const v1::WatchRecalibrationRequest& request,
    const Watch<v1::Recalibration>& watch) {
  SELFCAL_ASSIGN_OR_RETURN(const RunId id, ParseRun(request.name()));
  const auto put = [watch, store = context.store](
                       const StoredRun& run,
                       const CalibrateProgress& progress) {
    // Each iteration has a key of its own: a reader that plots them all gets
    // them all.
    watch.Put(
        std::to_string(run.attempts) + "." + std::to_string(progress.iteration),
        [=](v1::Recalibration* to) -> absl::StatusOr<bool> {
          SELFCAL_ASSIGN_OR_RETURN(*to, EncodeWithReport(store, run, progress));
          return true;
        });
  };
  auto subscription =
      context.pipeline->WatchRun(id.rig, id.run, [=](const RunUpdate& update) {
        for (const CalibrateProgress& missed : update.missed) {
          put(update.run, missed);
        }
        put(update.run, update.progress);
        if (HasEnded(update.run.state)) watch.Close();
      });
  if (!subscription.ok()) {
    return About(subscription.status(), {kRunType, request.name(), "name"});
  }
  return std::shared_ptr<void>(*std::move(subscription));
}

absl::StatusOr<v1::Recalibration> CancelRecalibration(
    const ApiContext& context,
    const Call&,
    const v1::CancelRecalibrationRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const RunId id, ParseRun(request.name()));
  const auto run = context.pipeline->CancelRecalibration(id.rig, id.run);
  if (!run.ok()) return About(run.status(), {kRunType, request.name(), {}});
  return EncodeWithReport(context.store, *run, {});
}

}  // namespace

void AddRecalibrationMethods(Methods* methods) {
  methods->Add(StartRecalibration);
  methods->Add(GetRecalibration);
  methods->Add(ListRecalibrations);
  methods->Add(WatchRecalibration);
  methods->Add(CancelRecalibration);
}

}  // namespace selfcal::server
