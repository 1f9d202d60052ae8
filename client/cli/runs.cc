#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/run_following.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"

namespace selfcal::client {
namespace {

using RecalibrationService = v1::RecalibrationService::StubInterface;

struct RunOptions {
  std::string rig;
  std::string run;
};

int ListRuns(Context* context, const RunOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::ListRecalibrationsRequest request;
  request.set_parent(RigName(options.rig));
  v1::ListRecalibrationsResponse runs;
  const auto status = CallForAllPages<RecalibrationService>(
      stub.get(), &RecalibrationService::ListRecalibrations, request, &runs);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(runs);
    return kDone;
  }
  Table table({{"run", true},
               {"state"},
               {"trigger"},
               {"created"},
               {"ended"},
               {"segments", true},
               {"calibration", true},
               {"message"}});
  for (const v1::Recalibration& run : runs.recalibrations()) {
    table.Add({LastPart(run.name()),
               StateText(run.state()),
               TriggerText(run.trigger()),
               TimeText(run.create_time()),
               TimeText(run.end_time()),
               fmt::format("{}", run.segments_size()),
               run.calibration().empty() ? "-" : LastPart(run.calibration()),
               run.message()});
  }
  context->Print(table);
  return kDone;
}

// Makes a call about a run: the request names it, the response is the run.
template <typename Request>
grpc::Status GetRun(
    RecalibrationService* stub,
    grpc::Status (RecalibrationService::*method)(grpc::ClientContext*,
                                                 const Request&,
                                                 v1::Recalibration*),
    const RunOptions& options,
    v1::Recalibration* run) {
  Request request;
  request.set_name(ChildName(options.rig, "recalibrations", options.run));
  return Call<RecalibrationService>(stub, method, request, run);
}

int ShowRun(Context* context, const RunOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::Recalibration run;
  const auto status = GetRun(
      stub.get(), &RecalibrationService::GetRecalibration, options, &run);
  if (!status.ok()) return Fail(*context, status);
  PrintRun(*context, run);
  return kDone;
}

int WatchRun(Context* context, const RunOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::Recalibration run;
  const auto status = GetRun(
      stub.get(), &RecalibrationService::GetRecalibration, options, &run);
  if (!status.ok()) return Fail(*context, status);
  return FollowRun(
      context, stub.get(), std::move(run), ShownAsJson::kEachUpdate);
}

int Cancel(Context* context, const RunOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::Recalibration run;
  const auto status = GetRun(
      stub.get(), &RecalibrationService::CancelRecalibration, options, &run);
  if (!status.ok()) return Fail(*context, status);
  PrintRun(*context, run);
  return kDone;
}

int ShowConvergence(Context* context, const RunOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::Recalibration run;
  const auto status = GetRun(
      stub.get(), &RecalibrationService::GetRecalibration, options, &run);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(run);
    return kDone;
  }
  Table table({{"iteration", true}, {"cost", true}, {"step [sigma]", true}});
  for (const v1::ConvergenceStep& step : run.convergence()) {
    table.Add({fmt::format("{}", step.iteration()),
               fmt::format("{:.6g}", step.cost()),
               fmt::format("{:.3g}", step.step_sigmas())});
  }
  context->Print(table);
  return kDone;
}

}  // namespace

void AddRunCommands(CLI::App* app, Context* context) {
  CLI::App* runs =
      app->add_subcommand("runs", "Show and cancel recalibrations");
  runs->require_subcommand(1);
  const auto options = std::make_shared<RunOptions>();

  CLI::App* list =
      runs->add_subcommand("list", "List the runs of a rig, newest first");
  list->add_option("RIG", options->rig)->required();
  list->callback([context, options] {
    context->command = [context, options] {
      return ListRuns(context, *options);
    };
  });

  const auto add = [&](const char* name, const char* what, auto command) {
    CLI::App* about_one = runs->add_subcommand(name, what);
    about_one->add_option("RIG", options->rig)->required();
    about_one->add_option("RUN", options->run, "Its number")->required();
    about_one->callback([context, options, command] {
      context->command = [context, options, command] {
        return command(context, *options);
      };
    });
  };
  add("show", "Show a run", ShowRun);
  add("watch",
      "Wait for the end of a run and show the result; exits with 1 if the "
      "result was rejected. With --json, prints a line for each iteration",
      WatchRun);
  add("convergence",
      "Show the iterations of a run that has computed a version; --json has "
      "the "
      "estimate of each parameter, too",
      ShowConvergence);
  add("cancel",
      "Cancel a run that has not ended; its result is discarded",
      Cancel);
}

}  // namespace selfcal::client
