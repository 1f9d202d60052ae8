#include <absl/strings/numbers.h>
#include <fmt/format.h>

#include <limits>
#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/filter_command.h"
#include "client/cli/list_options.h"
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

std::vector<FilterField> RunFields() {
  using Kind = FilterField::Kind;
  return {{"run", Kind::kNumber},
          {"state",
           Kind::kText,
           WordsOf<v1::Recalibration::State>(
               v1::Recalibration::State_descriptor(), StateText),
           "state"},
          {"trigger",
           Kind::kText,
           WordsOf<v1::Recalibration::Trigger>(
               v1::Recalibration::Trigger_descriptor(), TriggerText),
           "trigger"},
          {"created", Kind::kTime, {}, "create_time"},
          {"ended", Kind::kTime},
          {"segments", Kind::kNumber},
          {"calibration", Kind::kNumber}};
}

// The number at the end of a name; NaN if there is none.
double NumberOf(const std::string& name) {
  double number = std::numeric_limits<double>::quiet_NaN();
  if (!absl::SimpleAtod(LastPart(name), &number)) {
    number = std::numeric_limits<double>::quiet_NaN();
  }
  return number;
}

FieldValue ValueOf(const v1::Recalibration& run, std::string_view field) {
  if (field == "run") return NumberOf(run.name());
  if (field == "state") return StateText(run.state());
  if (field == "trigger") return TriggerText(run.trigger());
  if (field == "created") return FilterTime(run.create_time());
  if (field == "ended") return FilterTime(run.end_time());
  if (field == "calibration") return NumberOf(run.calibration());
  return static_cast<double>(run.segments_size());
}

int ListRuns(Context* context,
             const std::string& rig,
             const ListOptions& options) {
  const auto wanted = Wanted<v1::Recalibration>(options, RunFields(), ValueOf);
  if (!wanted.ok()) return FailInput(wanted.status());
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::ListRecalibrationsRequest request;
  if (!rig.empty()) request.set_parent(RigName(rig));
  request.set_rig_filter(options.rigs);
  request.set_filter(wanted->for_daemon);
  request.set_order_by(options.order_by);
  v1::ListRecalibrationsResponse runs;
  const auto status = CallForItems<RecalibrationService>(
      stub.get(),
      &RecalibrationService::ListRecalibrations,
      request,
      &v1::ListRecalibrationsResponse::mutable_recalibrations,
      options.limit,
      wanted->test,
      &runs);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(runs)) return kDone;
  std::vector<Column> columns = {{"run", true},
                                 {"state"},
                                 {"trigger"},
                                 {"created"},
                                 {"ended"},
                                 {"segments", true},
                                 {"calibration", true},
                                 {"message", false, true}};
  if (rig.empty()) columns.insert(columns.begin(), Column{"rig"});
  Table table(std::move(columns));
  for (const v1::Recalibration& run : runs.recalibrations()) {
    std::vector<std::string> cells = {
        LastPart(run.name()),
        StateText(run.state()),
        TriggerText(run.trigger()),
        TimeText(run.create_time()),
        TimeText(run.end_time()),
        fmt::format("{}", run.segments_size()),
        run.calibration().empty() ? "-" : LastPart(run.calibration()),
        run.message()};
    if (rig.empty()) cells.insert(cells.begin(), RigPart(run.name()));
    table.Add(std::move(cells));
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
      app->add_subcommand("run", "Start, show and cancel recalibrations")
          ->alias("runs");
  runs->require_subcommand(1);
  const auto options = std::make_shared<RunOptions>();

  CLI::App* list = runs->add_subcommand(
      "list", "List the runs of a rig, or of all, newest first");
  CLI::Option* const of = list->add_option("RIG", options->rig);
  const auto list_options = std::make_shared<ListOptions>();
  AddListOptions(list,
                 context,
                 "the first of the list",
                 FilterHelp("state = failed AND created >= 7d", RunFields()),
                 list_options.get());
  AddOrderBy(list, ": create_time or duration", list_options.get());
  AddRigFilter(list, of, list_options.get());
  list->callback([context, options, list_options] {
    context->command = [context, options, list_options] {
      return ListRuns(context, options->rig, *list_options);
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
  AddRunStart(runs, "start", context);
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
