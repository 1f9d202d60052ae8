#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "server/console/asked.h"
#include "server/encode/encode.h"
#include "server/encode/versions.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

struct RunId {
  std::string rig;
  std::int64_t run = 0;
};

absl::StatusOr<RunId> RunOf(const Call& call, const std::string& text) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  const auto run = ParseCount(text);
  if (run) return RunId{rig, *run};
  return absl::InvalidArgumentError("a run must be a number >= 1");
}

HttpResponse StreamResponse(std::shared_ptr<Outbox> outbox) {
  HttpResponse response;
  response.type = "text/event-stream";
  response.stream = std::move(outbox);
  return response;
}

bool HasEnded(RunState state) {
  return state != RunState::kPending && state != RunState::kRunning;
}

std::string RunLine(const StoredRun& run, const CalibrateProgress& progress) {
  return "event: run\ndata: " +
         JsonResponse(Encode(run, progress, nullptr)).body + "\n\n";
}

// Streams each iteration of a run from the first, until it has ended.
Answer OpenRunStream(const Call& call, const std::string& name) {
  v1::WatchRecalibrationRequest request;
  request.set_name(name);
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  const auto parts = ParseChildName(name, "recalibrations");
  const auto run = parts ? ParseCount(parts->id) : std::nullopt;
  if (!run) {
    return absl::InvalidArgumentError(
        "run must be a name of the form rigs/{rig}/recalibrations/{run}");
  }
  auto outbox = std::make_shared<Outbox>("event: run\ndata: {}\n\n");
  SELFCAL_ASSIGN_OR_RETURN(
      auto subscription,
      call.context.pipeline->WatchRun(
          parts->rig, *run, [outbox](const RunUpdate& update) {
            for (const CalibrateProgress& missed : update.missed) {
              outbox->Put(RunLine(update.run, missed));
            }
            outbox->Put(RunLine(update.run, update.progress));
            if (HasEnded(update.run.state)) outbox->Close();
          }));
  HttpResponse response = StreamResponse(std::move(outbox));
  response.keep = std::move(subscription);
  return response;
}

}  // namespace

Answer ListRuns(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListRecalibrationsRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<v1::ListRecalibrationsResponse>(
      call.context.store->ListRuns(rig, page),
      [&](const StoredRun& run, auto* response) -> absl::Status {
        SELFCAL_ASSIGN_OR_RETURN(*response->add_recalibrations(),
                                 EncodeWithReport(call.context.store, run, {}));
        return absl::OkStatus();
      });
}

Answer GetRun(const Call& call) {
  v1::GetRecalibrationRequest request;
  request.set_name(
      ChildName(call.parts.at(0), "recalibrations", call.parts.at(1)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const RunId id, RunOf(call, call.parts[1]));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                           call.context.store->GetRun(id.rig, id.run));
  SELFCAL_ASSIGN_OR_RETURN(const v1::Recalibration encoded,
                           EncodeWithReport(call.context.store, run, {}));
  return JsonResponse(encoded);
}

// Opens a stream about a run, a rig (by its id) or everything.
Answer OpenStream(const Call& call) {
  const std::string run = call.Query("run");
  if (!run.empty()) return OpenRunStream(call, run);
  const std::string rig = call.Query("rig");
  if (rig.empty()) {
    SELFCAL_RETURN_IF_ERROR(
        Authorise(call.request.caller, v1::ListRigsRequest()));
  } else {
    v1::WatchCalibrationRequest request;
    request.set_parent(RigName(rig));
    SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
    SELFCAL_RETURN_IF_ERROR(call.context.store->GetRig(rig).status());
  }
  return StreamResponse(call.context.feed->Subscribe(rig));
}

}  // namespace selfcal::server
