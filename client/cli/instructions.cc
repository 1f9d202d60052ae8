// instruction list: what a hub has devices do, and what became of it.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/device_reports.h"
#include "client/cli/instruction.h"
#include "client/cli/list_options.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/uplink.grpc.pb.h"

namespace selfcal::client {
namespace {

using UplinkService = v1::UplinkService::StubInterface;

// "pending", "done" or "refused".
std::string StateText(v1::Instruction::State state) {
  switch (state) {
    case v1::Instruction::DONE:
      return "done";
    case v1::Instruction::REFUSED:
      return "refused";
    default:
      return "pending";
  }
}

std::string QuarantineText(const v1::QuarantineSegmentsRequest& request) {
  const std::string which =
      request.has_index()
          ? fmt::format("segment {}~{}", request.session(), request.index())
          : "segments of session " + request.session();
  return fmt::format("quarantine {}: {}", which, request.reason());
}

std::string RequestText(const v1::Instruction& instruction) {
  switch (instruction.request_case()) {
    case v1::Instruction::kActivateCalibration:
      return fmt::format("activate version {}: {}",
                         LastPart(instruction.activate_calibration().name()),
                         instruction.activate_calibration().reason());
    case v1::Instruction::kUpdateRig:
      return instruction.update_rig().reason().empty()
                 ? "change the rig"
                 : "change the rig: " + instruction.update_rig().reason();
    case v1::Instruction::kStartRecalibration:
      return "recalibrate";
    case v1::Instruction::kQuarantineSegments:
      return QuarantineText(instruction.quarantine_segments());
    case v1::Instruction::REQUEST_NOT_SET:
      break;
  }
  return "unknown";
}

int List(Context* context, const std::string& rig, const ListOptions& options) {
  const auto stub = v1::UplinkService::NewStub(context->Channel());
  v1::ListInstructionsRequest request;
  request.set_parent(RigName(rig));
  v1::ListInstructionsResponse instructions;
  const auto status = CallForItems<UplinkService>(
      stub.get(),
      &UplinkService::ListInstructions,
      request,
      &v1::ListInstructionsResponse::mutable_instructions,
      options.limit,
      nullptr,
      &instructions);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(instructions)) return kDone;
  Table table({{"instruction", true},
               {"created"},
               {"by"},
               {"state"},
               {"what"},
               {"message", false, true}});
  for (const v1::Instruction& instruction : instructions.instructions()) {
    table.Add({LastPart(instruction.name()),
               TimeText(instruction.create_time()),
               instruction.caller(),
               StateText(instruction.state()),
               RequestText(instruction),
               instruction.message()});
  }
  context->Print(table);
  return kDone;
}

}  // namespace

std::optional<v1::Instruction> InsteadOf(const grpc::Status& failed,
                                         const Context& context,
                                         const std::string& rig,
                                         const v1::Instruction& instruction,
                                         grpc::Status* failure) {
  if (failed.error_code() != grpc::StatusCode::FAILED_PRECONDITION ||
      !ReadDeviceReports(context, rig)) {
    return std::nullopt;
  }
  const auto stub = v1::UplinkService::NewStub(context.Channel());
  v1::CreateInstructionRequest request;
  request.set_parent(RigName(rig));
  *request.mutable_instruction() = instruction;
  v1::Instruction given;
  *failure = Call<UplinkService>(
      stub.get(), &UplinkService::CreateInstruction, request, &given);
  if (!failure->ok()) return std::nullopt;
  return given;
}

void PrintGiven(const Context& context, const v1::Instruction& instruction) {
  if (context.json) return context.PrintJson(instruction);
  PrintText(fmt::format(
      "instruction {0} is given to the device of rig {1}: it is carried out "
      "with the next report, and 'selfcal instruction list {1}' shows its "
      "result\n",
      LastPart(instruction.name()),
      RigPart(instruction.name())));
}

std::optional<int> EndFailed(const grpc::Status& status,
                             const Context& context,
                             const std::string& rig,
                             const v1::Instruction& instruction) {
  if (status.ok()) return std::nullopt;
  grpc::Status failure = status;
  const auto given = InsteadOf(status, context, rig, instruction, &failure);
  if (!given) return Fail(context, failure);
  PrintGiven(context, *given);
  return kDone;
}

void AddInstructionCommands(CLI::App* app, Context* context) {
  CLI::App* instruction = app->add_subcommand(
      "instruction", "Show the instructions of this hub for devices");
  instruction->require_subcommand(1);
  CLI::App* list = instruction->add_subcommand(
      "list", "List the instructions for the device of a rig, newest first");
  const auto rig = std::make_shared<std::string>();
  list->add_option("RIG", *rig)->required();
  const auto options = std::make_shared<ListOptions>();
  list->add_option("--limit", options->limit, "Only the newest; 0: all");
  AddCsv(list, context);
  list->callback([context, rig, options] {
    context->command = [context, rig, options] {
      return List(context, *rig, *options);
    };
  });
}

}  // namespace selfcal::client
