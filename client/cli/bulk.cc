#include "client/cli/bulk.h"

#include <fmt/format.h>

#include <cstdint>

#include "client/cli/confirmation.h"
#include "client/cli/instruction.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

// False if the call failed, and the device of the rig, if one reports it, could
// not be instructed either.
bool IsMade(const Context& context,
            const BulkWords& words,
            const BulkChange& change) {
  const grpc::Status status = change.call();
  if (status.ok()) return true;
  grpc::Status failure = status;
  if (const auto given = InsteadOf(
          status, context, change.rig, change.instruction, &failure)) {
    // --json prints what is changed alone.
    if (!context.json) PrintGiven(context, *given);
    return true;
  }
  PrintError(fmt::format("{} is not {}: {}",
                         change.rig,
                         words.participle,
                         failure.error_message()));
  return false;
}

}  // namespace

CLI::Option* AddBulkOptions(CLI::App* command, BulkOptions* options) {
  CLI::Option* const filter = command->add_option(
      "--filter",
      options->filter,
      "All rigs that match, e.g. 'labels.batch = \"2026-10\"'");
  command
      ->add_flag(
          "--dry-run", options->dry_run, "Only show what would be changed")
      ->needs(filter);
  command->add_flag("--yes", options->yes, "Do not ask for confirmation")
      ->needs(filter);
  return filter;
}

grpc::Status ReadRigs(const Context& context,
                      const std::string& filter,
                      std::vector<v1::Rig>* rigs) {
  const auto stub = v1::RigService::NewStub(context.Channel());
  v1::ListRigsRequest request;
  request.set_filter(filter);
  v1::ListRigsResponse listed;
  grpc::Status status = CallForAllPages<RigService>(
      stub.get(), &RigService::ListRigs, request, &listed);
  if (status.ok()) rigs->assign(listed.rigs().begin(), listed.rigs().end());
  return status;
}

BulkChange UpdateOf(RigService* stub, const v1::UpdateRigRequest& request) {
  BulkChange change;
  change.rig = LastPart(request.rig().name());
  *change.instruction.mutable_update_rig() = request;
  change.call = [stub, request] {
    v1::Rig rig;
    return Call<RigService>(stub, &RigService::UpdateRig, request, &rig);
  };
  return change;
}

int CarryOut(const Context& context,
             const BulkOptions& options,
             const BulkWords& words,
             const std::vector<BulkChange>& changes) {
  if (options.dry_run || changes.empty()) return kDone;
  const std::string rigs =
      CountText(static_cast<std::int64_t>(changes.size()), "rig");
  if (!options.yes &&
      !Confirmed(fmt::format(
          "{} {} at {}?", words.imperative, rigs, context.target.address))) {
    PrintError("nothing was changed; use --yes to go on without a prompt");
    return kUsage;
  }
  int failed = 0;
  for (const BulkChange& change : changes) {
    if (!IsMade(context, words, change)) ++failed;
  }
  if (failed == 0) return kDone;
  PrintError(fmt::format("{} of {} failed", failed, rigs));
  return kFailed;
}

}  // namespace selfcal::client
