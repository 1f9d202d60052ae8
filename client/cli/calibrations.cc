#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "client/cli/calibration_report.h"
#include "client/cli/commands.h"
#include "client/cli/filter_command.h"
#include "client/cli/instruction.h"
#include "client/cli/list_options.h"
#include "client/cli/positive_number.h"
#include "client/cli/temperature_option.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using CalibrationService = v1::CalibrationService::StubInterface;

std::vector<FilterField> CalibrationFields() {
  using Kind = FilterField::Kind;
  return {{"version", Kind::kNumber},
          {"state",
           Kind::kText,
           WordsOf<v1::Calibration::State>(v1::Calibration::State_descriptor(),
                                           StateText),
           "state"},
          {"created", Kind::kTime, {}, "create_time"},
          {"verdict",
           Kind::kText,
           {"good", "weak", "not-trustworthy", "factory", "unknown"},
           "verdict"},
          {"temperature_c", Kind::kNumber, {}, "temperature_c"}};
}

FieldValue ValueOf(const v1::Calibration& calibration, std::string_view field) {
  if (field == "state") return StateText(calibration.state());
  if (field == "created") return FilterTime(calibration.create_time());
  if (field == "verdict") return VerdictText(calibration);
  if (field == "temperature_c") {
    return calibration.provenance().has_temperature()
               ? calibration.provenance().temperature().mean_c()
               : std::numeric_limits<double>::quiet_NaN();
  }
  return static_cast<double>(calibration.version());
}

int ListCalibrations(Context* context,
                     const std::string& rig,
                     const ListOptions& options) {
  const auto wanted =
      Wanted<v1::Calibration>(options, CalibrationFields(), ValueOf);
  if (!wanted.ok()) return FailInput(wanted.status());
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::ListCalibrationsRequest request;
  if (!rig.empty()) request.set_parent(RigName(rig));
  request.set_rig_filter(options.rigs);
  request.set_filter(wanted->for_daemon);
  request.set_order_by(options.order_by);
  if (!context->json && !context->csv) {
    request.set_view(v1::ListCalibrationsRequest::BASIC);
  }
  v1::ListCalibrationsResponse calibrations;
  const auto status = CallForItems<CalibrationService>(
      stub.get(),
      &CalibrationService::ListCalibrations,
      request,
      &v1::ListCalibrationsResponse::mutable_calibrations,
      options.limit,
      wanted->test,
      &calibrations);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(calibrations)) return kDone;
  std::vector<Column> columns = {{"version", true},
                                 {"state"},
                                 {"created"},
                                 {"origin"},
                                 {"verdict"},
                                 {"reasons", false, true}};
  if (rig.empty()) columns.insert(columns.begin(), Column{"rig"});
  Table table(std::move(columns));
  for (const v1::Calibration& calibration : calibrations.calibrations()) {
    std::vector<std::string> cells = {
        fmt::format("{}", calibration.version()),
        StateText(calibration.state()),
        TimeText(calibration.create_time()),
        OriginText(calibration),
        VerdictText(calibration),
        fmt::format("{}", fmt::join(calibration.reasons(), " "))};
    if (rig.empty()) cells.insert(cells.begin(), RigPart(calibration.name()));
    table.Add(std::move(cells));
  }
  context->Print(table);
  return kDone;
}

int ShowCalibration(Context* context,
                    const std::string& rig,
                    const std::string& version,
                    std::optional<double> temperature_c) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(ChildName(rig, "calibrations", version));
  if (temperature_c) request.set_temperature_c(*temperature_c);
  v1::Calibration calibration;
  const auto status = Call<CalibrationService>(
      stub.get(), &CalibrationService::GetCalibration, request, &calibration);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(calibration);
    return kDone;
  }
  context->Print(DescribeCalibration(calibration));
  if (context->terminal) PrintText("\n");
  context->Print(CalibrationValues(calibration));
  return kDone;
}

int Activate(Context* context,
             const std::string& rig,
             const std::string& version,
             const std::string& reason) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::ActivateCalibrationRequest request;
  request.set_name(ChildName(rig, "calibrations", version));
  request.set_reason(reason);
  v1::Calibration calibration;
  const auto status =
      Call<CalibrationService>(stub.get(),
                               &CalibrationService::ActivateCalibration,
                               request,
                               &calibration);
  v1::Instruction instruction;
  *instruction.mutable_activate_calibration() = request;
  if (const auto code = EndFailed(status, *context, rig, instruction)) {
    return *code;
  }
  if (context->json) {
    context->PrintJson(calibration);
  } else {
    PrintText(CalibrationLine(calibration) + "\n");
  }
  return kDone;
}

int Compare(Context* context,
            const std::string& rig,
            const std::string& a,
            const std::string& b) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::CompareCalibrationsRequest request;
  request.set_a(ChildName(rig, "calibrations", a));
  request.set_b(ChildName(rig, "calibrations", b));
  v1::CompareCalibrationsResponse differences;
  const auto status =
      Call<CalibrationService>(stub.get(),
                               &CalibrationService::CompareCalibrations,
                               request,
                               &differences);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(differences);
    return kDone;
  }
  context->Print(DescribeDifferences(differences));
  if (context->terminal) PrintText("\n");
  context->Print(DifferenceValues(differences));
  return kDone;
}

// Prints `count` versions or, if `count` is 0, continues until the daemon ends
// the stream.
int WatchCalibrations(Context* context,
                      const std::string& rig,
                      std::int64_t count) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  grpc::ClientContext call;
  v1::WatchCalibrationRequest request;
  request.set_parent(RigName(rig));
  const auto stream = stub->WatchCalibration(&call, request);
  v1::Calibration calibration;
  for (std::int64_t seen = 1; stream->Read(&calibration); ++seen) {
    if (context->json) {
      context->PrintJson(calibration, true);
    } else {
      PrintText(CalibrationLine(calibration) + "\n");
    }
    if (seen == count) {
      call.TryCancel();
      return kDone;
    }
  }
  grpc::Status status = stream->Finish();
  if (status.ok()) {
    status = {grpc::StatusCode::UNAVAILABLE, "the daemon ended the stream"};
  }
  return Fail(*context, status);
}

}  // namespace

void AddCalibrationCommands(CLI::App* app, Context* context) {
  CLI::App* calibrations =
      app->add_subcommand("calibration", "Show versions of the calibration")
          ->alias("calibrations");
  calibrations->require_subcommand(1);
  const auto rig = std::make_shared<std::string>();

  CLI::App* list = calibrations->add_subcommand(
      "list", "List the versions of a rig, or of all, newest first");
  CLI::Option* const of = list->add_option("RIG", *rig);
  const auto options = std::make_shared<ListOptions>();
  AddListOptions(
      list,
      context,
      "the first of the list",
      FilterHelp("state = rejected AND created >= 30d", CalibrationFields()),
      options.get());
  AddOrderBy(list, ": create_time or temperature_c", options.get());
  AddRigFilter(list, of, options.get());
  list->callback([context, rig, options] {
    context->command = [context, rig, options] {
      return ListCalibrations(context, *rig, *options);
    };
  });

  const auto version = std::make_shared<std::string>("active");
  CLI::App* show = calibrations->add_subcommand("show", "Show a version");
  show->add_option("RIG", *rig)->required();
  show->add_option("VERSION", *version, "A number, or active")
      ->capture_default_str();
  const auto temperature_c = std::make_shared<std::optional<double>>();
  AddTemperature(show, "Temperature of the values", temperature_c.get());
  show->callback([context, rig, version, temperature_c] {
    context->command = [context, rig, version, temperature_c] {
      return ShowCalibration(context, *rig, *version, *temperature_c);
    };
  });

  const auto reason = std::make_shared<std::string>();
  CLI::App* activate = calibrations->add_subcommand(
      "activate",
      "Make a version active; if it is older than the active version, that one "
      "is rolled back");
  activate->add_option("RIG", *rig)->required();
  activate->add_option("VERSION", *version, "A number")->required();
  activate
      ->add_option("--reason",
                   *reason,
                   "The reason; the event log records it with your name")
      ->required();
  activate->callback([context, rig, version, reason] {
    context->command = [context, rig, version, reason] {
      return Activate(context, *rig, *version, *reason);
    };
  });

  const auto other = std::make_shared<std::string>("active");
  CLI::App* compare =
      calibrations
          ->add_subcommand("compare",
                           "Compare two versions, given their uncertainty")
          ->alias("diff");
  compare->add_option("RIG", *rig)->required();
  compare->add_option("A", *version, "A number, or active")->required();
  compare->add_option("B", *other, "A number, or active")
      ->capture_default_str();
  compare->callback([context, rig, version, other] {
    context->command = [context, rig, version, other] {
      return Compare(context, *rig, *version, *other);
    };
  });

  AddCalibrationExport(calibrations, context);
  AddCalibrationRollback(calibrations, context);
  AddCalibrationReport(calibrations, "report", context);

  const auto count = std::make_shared<std::int64_t>(0);
  CLI::App* watch = calibrations->add_subcommand(
      "watch", "Print the active version at once, then each new one");
  watch->add_option("RIG", *rig)->required();
  watch->add_option("--count", *count, "Exit after this many versions")
      ->check(AtLeastOne());
  watch->callback([context, rig, count] {
    context->command = [context, rig, count] {
      return WatchCalibrations(context, *rig, *count);
    };
  });
}

}  // namespace selfcal::client
