#include <memory>
#include <string>
#include <utility>

#include "client/cli/commands.h"
#include "client/cli/instruction.h"
#include "client/cli/run_following.h"
#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"

namespace selfcal::client {
namespace {

using RecalibrationService = v1::RecalibrationService::StubInterface;

struct RecalibrateOptions {
  std::string rig;
  bool force = false;
  bool no_wait = false;
};

int Recalibrate(Context* context, const RecalibrateOptions& options) {
  const auto stub = v1::RecalibrationService::NewStub(context->Channel());
  v1::StartRecalibrationRequest request;
  request.set_parent(RigName(options.rig));
  request.set_force(options.force);
  v1::Recalibration run;
  const grpc::Status status = Call<RecalibrationService>(
      stub.get(), &RecalibrationService::StartRecalibration, request, &run);
  v1::Instruction instruction;
  *instruction.mutable_start_recalibration() = request;
  if (const auto code = EndFailed(status, *context, options.rig, instruction)) {
    return *code;
  }
  if (!options.no_wait) return FollowRun(context, stub.get(), std::move(run));
  PrintRun(*context, run);
  return kDone;
}

}  // namespace

CLI::App* AddRunStart(CLI::App* parent,
                      const std::string& name,
                      Context* context) {
  CLI::App* recalibrate = parent->add_subcommand(
      name,
      "Calibrate on the segments of the tables; exits with 1 if the result was "
      "rejected");
  const auto options = std::make_shared<RecalibrateOptions>();
  recalibrate->add_option("RIG", options->rig)->required();
  recalibrate->add_flag("--force",
                        options->force,
                        "Run even if the tables have not changed since a "
                        "version was computed from them");
  recalibrate->add_flag("--no-wait", options->no_wait, "Start it and return");
  recalibrate->callback([context, options] {
    context->command = [context, options] {
      return Recalibrate(context, *options);
    };
  });
  return recalibrate;
}

}  // namespace selfcal::client
