#include "client/cli/run_following.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "client/cli/calibration_report.h"
#include "client/cli/progress.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using RecalibrationService = v1::RecalibrationService::StubInterface;

// How long to wait for a daemon that restarts; the run starts again then.
constexpr std::chrono::seconds kPatience{60};
constexpr std::chrono::milliseconds kReadEvery{500};

void ShowProgress(const v1::Recalibration& run, Progress* progress) {
  const auto iteration = static_cast<std::size_t>(std::max(run.iteration(), 0));
  const auto limit =
      static_cast<std::size_t>(std::max(run.max_iterations(), 0));
  progress->Show(iteration,
                 limit,
                 fmt::format("{}, cost {:.6g}, step {:.2g} sigma",
                             StateText(run.state()),
                             run.cost(),
                             run.step_sigmas()));
}

using OnUpdate = std::function<void(const v1::Recalibration&)>;

// Watches over one connection; *run is the last update, if there was any.
grpc::Status WatchOnce(RecalibrationService* stub,
                       const OnUpdate& on_update,
                       v1::Recalibration* run,
                       bool* updated) {
  grpc::ClientContext call;
  v1::WatchRecalibrationRequest request;
  request.set_name(run->name());
  const auto stream = stub->WatchRecalibration(&call, request);
  v1::Recalibration update;
  while (stream->Read(&update)) {
    *run = update;
    *updated = true;
    on_update(*run);
  }
  return stream->Finish();
}

grpc::Status WatchToEnd(RecalibrationService* stub,
                        const OnUpdate& on_update,
                        v1::Recalibration* run) {
  using Clock = std::chrono::steady_clock;
  auto give_up = Clock::now() + kPatience;
  while (!HasEnded(*run)) {
    bool updated = false;
    const grpc::Status status = WatchOnce(stub, on_update, run, &updated);
    if (!status.ok() && !IsUnreachable(status)) return status;
    if (updated) give_up = Clock::now() + kPatience;
    if (!status.ok() && Clock::now() > give_up) return status;
    if (!HasEnded(*run)) std::this_thread::sleep_for(kReadEvery);
  }
  return grpc::Status::OK;
}

// Shows the version that the run has computed; kFailed if it is not usable.
int ShowResult(Context* context, const v1::Recalibration& run) {
  if (run.state() != v1::Recalibration::SUCCEEDED) {
    PrintError(fmt::format(
        "the recalibration has {}: {}", StateText(run.state()), run.message()));
    return kFailed;
  }
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(run.calibration());
  v1::Calibration calibration;
  const auto status = Call<v1::CalibrationService::StubInterface>(
      stub.get(),
      &v1::CalibrationService::StubInterface::GetCalibration,
      request,
      &calibration);
  if (!status.ok()) return Fail(*context, status);
  if (!context->json) {
    if (context->terminal) PrintText("\n");
    Facts facts;
    facts.Add("verdict", VerdictText(calibration));
    context->Print(facts);
    if (context->terminal) PrintText("\n");
    context->Print(CalibrationValues(calibration));
  }
  if (calibration.state() != v1::Calibration::REJECTED) return kDone;
  PrintError(fmt::format("version {} was rejected: {}",
                         calibration.version(),
                         fmt::join(calibration.reasons(), " ")));
  return kFailed;
}

}  // namespace

bool HasEnded(const v1::Recalibration& run) {
  return run.state() == v1::Recalibration::SUCCEEDED ||
         run.state() == v1::Recalibration::FAILED ||
         run.state() == v1::Recalibration::CANCELLED;
}

grpc::Status ReadNewestRun(RecalibrationService* stub,
                           const std::string& rig,
                           v1::Recalibration* run) {
  v1::ListRecalibrationsRequest request;
  request.set_parent(RigName(rig));
  request.set_page_size(1);
  v1::ListRecalibrationsResponse listed;
  const grpc::Status status = Call<RecalibrationService>(
      stub, &RecalibrationService::ListRecalibrations, request, &listed);
  if (status.ok() && !listed.recalibrations().empty()) {
    *run = listed.recalibrations(0);
  }
  return status;
}

void PrintRun(const Context& context, const v1::Recalibration& run) {
  if (context.json) return context.PrintJson(run);
  Facts facts;
  facts.Add("recalibration", LastPart(run.name()));
  facts.Add("state", StateText(run.state()));
  facts.Add("trigger", TriggerText(run.trigger()));
  facts.Add("created", TimeText(run.create_time()));
  if (run.has_end_time()) facts.Add("ended", TimeText(run.end_time()));
  facts.Add("segments", fmt::format("{}", run.segments_size()));
  if (!run.message().empty()) facts.Add("message", run.message());
  if (!run.calibration().empty()) {
    facts.Add("calibration", LastPart(run.calibration()));
  }
  context.Print(facts);
}

int FollowRun(Context* context,
              RecalibrationService* stub,
              v1::Recalibration run,
              ShownAsJson shown) {
  const bool lines = context->json && shown == ShownAsJson::kEachUpdate;
  if (lines && HasEnded(run)) context->PrintJson(run, true);
  {
    Progress progress("recalibration");
    const auto show = [&](const v1::Recalibration& update) {
      ShowProgress(update, &progress);
      if (lines) context->PrintJson(update, true);
    };
    const grpc::Status status = WatchToEnd(stub, show, &run);
    if (!status.ok()) return Fail(*context, status);
  }
  if (!lines) PrintRun(*context, run);
  return ShowResult(context, run);
}

}  // namespace selfcal::client
