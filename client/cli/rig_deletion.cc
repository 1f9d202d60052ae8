// rig delete.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

struct RigDeletion {
  std::string rig;
  std::string reason;
};

int DeleteRig(Context* context, const RigDeletion& options) {
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::DeleteRigRequest request;
  request.set_name(RigName(options.rig));
  request.set_reason(options.reason);
  google::protobuf::Empty response;
  const auto status =
      Call<RigService>(stub.get(), &RigService::DeleteRig, request, &response);
  if (!status.ok()) return Fail(*context, status);
  if (!context->json) PrintText(fmt::format("deleted {}\n", request.name()));
  return kDone;
}

}  // namespace

void AddRigDeletion(CLI::App* rig, Context* context) {
  const auto options = std::make_shared<RigDeletion>();
  CLI::App* remove = rig->add_subcommand(
      "delete",
      "Delete a rig with all its segments, runs and calibrations. This cannot "
      "be undone");
  remove->add_option("RIG", options->rig)->required();
  remove
      ->add_option("--reason",
                   options->reason,
                   "The reason; the event log records it with your name")
      ->required();
  remove->callback([context, options] {
    context->command = [context, options] {
      return DeleteRig(context, *options);
    };
  });
}

}  // namespace selfcal::client
