// calibration rollback: makes the version before the active one active again,
// for all rigs of a filter. A rig that is rolled back already is left as it is,
// so that the command can be repeated where it failed for some rigs.
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/bulk.h"
#include "client/cli/commands.h"
#include "client/cli/time_input.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using google::protobuf::util::TimeUtil;
using CalibrationService = v1::CalibrationService::StubInterface;

struct Options {
  BulkOptions bulk;
  std::string reason;
  std::string since;
  bool again = false;
};

struct Rollback {
  std::string rig;
  std::int64_t from = 0;
  v1::Calibration to = {};
};

// The versions of a rig that a rollback depends on; 0: there is none.
struct Versions {
  std::int64_t active = 0;  // if it was created at or after the given time
  std::int64_t undone = 0;  // newer than the active one, and rolled back
  v1::Calibration before;   // was active before the active one
};

grpc::Status Read(CalibrationService* stub,
                  const std::string& rig,
                  const std::optional<google::protobuf::Timestamp>& since,
                  bool details,
                  Versions* read) {
  v1::ListCalibrationsRequest request;
  request.set_parent(RigName(rig));
  if (!details) request.set_view(v1::ListCalibrationsRequest::BASIC);
  v1::ListCalibrationsResponse versions;
  const grpc::Status status = CallForAllPages<CalibrationService>(
      stub, &CalibrationService::ListCalibrations, request, &versions);
  if (!status.ok()) return status;
  for (const v1::Calibration& version : versions.calibrations()) {  // newest
    if (version.state() == v1::Calibration::ACTIVE) {
      if (since && version.create_time() < *since) return status;
      read->active = version.version();
    } else if (version.state() == v1::Calibration::ROLLED_BACK &&
               read->active == 0 && read->undone == 0) {
      read->undone = version.version();
    } else if (version.state() == v1::Calibration::SUPERSEDED &&
               read->active != 0) {
      read->before = version;
      return status;
    }
  }
  return status;
}

// Appends the rollback of a rig, or says why it is left out.
grpc::Status Plan(const Context& context,
                  CalibrationService* stub,
                  const std::string& rig,
                  const std::optional<google::protobuf::Timestamp>& since,
                  bool again,
                  std::vector<Rollback>* plans) {
  Versions versions;
  const grpc::Status status = Read(stub, rig, since, context.json, &versions);
  if (status.error_code() == grpc::StatusCode::NOT_FOUND) {
    PrintError(fmt::format("{} does not exist any more", rig));
    return grpc::Status::OK;
  }
  if (!status.ok() || versions.active == 0) return status;
  if (versions.undone != 0 && !again) {
    PrintError(fmt::format(
        "{} is rolled back already, from version {} to {}; --again rolls it "
        "back further",
        rig,
        versions.undone,
        versions.active));
  } else if (versions.before.version() != 0) {
    plans->push_back({rig, versions.active, versions.before});
  }
  return status;
}

// Prints the versions alone with --json, one by one.
void PrintPlans(const Context& context, const std::vector<Rollback>& plans) {
  if (context.json) {
    for (const Rollback& plan : plans) context.PrintJson(plan.to);
    return;
  }
  Table table({{"rig"}, {"active", true}, {"back to", true}});
  for (const Rollback& plan : plans) {
    table.Add({plan.rig,
               std::to_string(plan.from),
               std::to_string(plan.to.version())});
  }
  context.Print(table);
}

std::vector<BulkChange> ChangesOf(CalibrationService* stub,
                                  const std::vector<Rollback>& plans,
                                  const std::string& reason) {
  std::vector<BulkChange> changes;
  for (const Rollback& plan : plans) {
    v1::ActivateCalibrationRequest request;
    request.set_name(
        ChildName(plan.rig, "calibrations", std::to_string(plan.to.version())));
    request.set_reason(reason);
    BulkChange& change = changes.emplace_back();
    change.rig = plan.rig;
    *change.instruction.mutable_activate_calibration() = request;
    change.call = [stub, request] {
      v1::Calibration calibration;
      return Call<CalibrationService>(stub,
                                      &CalibrationService::ActivateCalibration,
                                      request,
                                      &calibration);
    };
  }
  return changes;
}

int RollBack(Context* context, const Options& options) {
  std::optional<google::protobuf::Timestamp> since;
  if (!options.since.empty()) {
    const auto time = ParseTime(options.since, TimeUtil::GetCurrentTime());
    if (!time.ok()) return FailInput(time.status());
    since = *time;
  }
  std::vector<v1::Rig> rigs;
  grpc::Status status = ReadRigs(*context, options.bulk.filter, &rigs);
  if (!status.ok()) return Fail(*context, status);
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  std::vector<Rollback> plans;
  for (const v1::Rig& rig : rigs) {
    status = Plan(*context,
                  stub.get(),
                  LastPart(rig.name()),
                  since,
                  options.again,
                  &plans);
    if (!status.ok()) return Fail(*context, status);
  }
  PrintPlans(*context, plans);
  return CarryOut(*context,
                  options.bulk,
                  {"Roll back", "rolled back"},
                  ChangesOf(stub.get(), plans, options.reason));
}

}  // namespace

void AddCalibrationRollback(CLI::App* calibrations, Context* context) {
  const auto options = std::make_shared<Options>();
  CLI::App* rollback = calibrations->add_subcommand(
      "rollback",
      "Make the version before the active one active again, for all rigs of a "
      "filter");
  AddBulkOptions(rollback, &options->bulk)->required();
  rollback
      ->add_option("--reason",
                   options->reason,
                   "The reason; the event logs record it with your name")
      ->required();
  rollback->add_option("--since",
                       options->since,
                       "Only where the active version was created since then: "
                       "a time in UTC, or 2d");
  rollback->add_flag(
      "--again",
      options->again,
      "Also where a version was rolled back before, and no newer "
      "one has become active since");
  rollback->callback([context, options] {
    context->command = [context, options] {
      return RollBack(context, *options);
    };
  });
}

}  // namespace selfcal::client
