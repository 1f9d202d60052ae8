#include <memory>
#include <string>
#include <utility>

#include "client/cli/commands.h"
#include "client/cli/run_following.h"
#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"

namespace selfcal::client {
namespace {

using Service = v1::RecalibrationService::StubInterface;

int Recalibrate(Context* context, const std::string& rig, bool no_wait) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::StartRecalibrationRequest request;
  request.set_parent(RigName(rig));
  v1::Recalibration run;
  const grpc::Status status =
      Call<Service>(stub.get(), &Service::StartRecalibration, request, &run);
  if (!status.ok()) return Fail(*context, status);
  if (!no_wait) return FollowRun(context, stub.get(), std::move(run));
  PrintRun(*context, run);
  return kDone;
}

}  // namespace

void AddRecalibrateCommand(CLI::App* app, Context* context) {
  CLI::App* recalibrate = app->add_subcommand(
      "recalibrate",
      "Calibrate on the segments of the tables; exits with 1 if the result was "
      "rejected");
  const auto rig = std::make_shared<std::string>();
  const auto no_wait = std::make_shared<bool>(false);
  recalibrate->add_option("RIG", *rig)->required();
  recalibrate->add_flag("--no-wait", *no_wait, "Start it and return");
  recalibrate->callback([context, rig, no_wait] {
    context->command = [context, rig, no_wait] {
      return Recalibrate(context, *rig, *no_wait);
    };
  });
}

}  // namespace selfcal::client
