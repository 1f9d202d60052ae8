#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <string>

#include "client/cli/calibration_report.h"
#include "client/cli/commands.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using CalibrationService = v1::CalibrationService::StubInterface;

int ListCalibrations(Context* context, const std::string& rig) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::ListCalibrationsRequest request;
  request.set_parent(RigName(rig));
  v1::ListCalibrationsResponse calibrations;
  const auto status =
      CallForAllPages<CalibrationService>(stub.get(),
                                          &CalibrationService::ListCalibrations,
                                          request,
                                          &calibrations);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(calibrations);
    return kDone;
  }
  Table table({{"version", true},
               {"state"},
               {"created"},
               {"origin"},
               {"verdict"},
               {"reasons"}});
  for (const v1::Calibration& calibration : calibrations.calibrations()) {
    table.Add({fmt::format("{}", calibration.version()),
               StateText(calibration.state()),
               TimeText(calibration.create_time()),
               OriginText(calibration),
               VerdictText(calibration),
               fmt::format("{}", fmt::join(calibration.reasons(), " "))});
  }
  context->Print(table);
  return kDone;
}

int ShowCalibration(Context* context,
                    const std::string& rig,
                    const std::string& version) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(ChildName(rig, "calibrations", version));
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
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(calibration);
  } else {
    PrintText(CalibrationLine(calibration) + "\n");
  }
  return kDone;
}

int Diff(Context* context,
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
      app->add_subcommand("calibrations", "Show versions of the calibration");
  calibrations->require_subcommand(1);
  const auto rig = std::make_shared<std::string>();

  CLI::App* list =
      calibrations->add_subcommand("list", "List the versions, newest first");
  list->add_option("RIG", *rig)->required();
  list->callback([context, rig] {
    context->command = [context, rig] {
      return ListCalibrations(context, *rig);
    };
  });

  const auto version = std::make_shared<std::string>("active");
  CLI::App* show = calibrations->add_subcommand("show", "Show a version");
  show->add_option("RIG", *rig)->required();
  show->add_option("VERSION", *version, "A number, or active")
      ->capture_default_str();
  show->callback([context, rig, version] {
    context->command = [context, rig, version] {
      return ShowCalibration(context, *rig, *version);
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
  CLI::App* diff = calibrations->add_subcommand(
      "diff", "Compare two versions, given their uncertainty");
  diff->add_option("RIG", *rig)->required();
  diff->add_option("A", *version, "A number, or active")->required();
  diff->add_option("B", *other, "A number, or active")->capture_default_str();
  diff->callback([context, rig, version, other] {
    context->command = [context, rig, version, other] {
      return Diff(context, *rig, *version, *other);
    };
  });

  AddCalibrationExport(calibrations, context);

  const auto count = std::make_shared<std::int64_t>(0);
  CLI::App* watch = calibrations->add_subcommand(
      "watch", "Print the active version at once, then each new one");
  watch->add_option("RIG", *rig)->required();
  watch->add_option("--count", *count, "Exit after this many versions")
      ->check(CLI::PositiveNumber);
  watch->callback([context, rig, count] {
    context->command = [context, rig, count] {
      return WatchCalibrations(context, *rig, *count);
    };
  });
}

}  // namespace selfcal::client
