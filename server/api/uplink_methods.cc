#include <string>

#include "proto/resource_names.h"
#include "proto/safe_text.h"
#include "selfcal/v1/uplink.pb.h"
#include "server/access/rules.h"
#include "server/api/errors.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/encode/encode_instruction.h"
#include "server/encode/versions.h"
#include "server/status/status_macros.h"
#include "server/store/report.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxProgramVersion = 100;
constexpr std::size_t kMaxMessage = 2000;

absl::StatusOr<DeviceReport> ReadReport(const v1::ReportRequest& request) {
  const auto rig = ParseRigName(request.rig());
  if (!rig) return BadName("rig", "rigs/{rig}");
  if (request.key() < 1) return InvalidFields({{"key", "must be positive"}});
  if (request.number() < 1) {
    return InvalidFields({{"number", "must be positive"}});
  }
  if (request.attempt() < 0) {
    return InvalidFields({{"attempt", "must not be negative"}});
  }
  if (request.program_version().size() > kMaxProgramVersion) {
    return InvalidFields({{"program_version", "is longer than 100 bytes"}});
  }
  DeviceReport report{.rig = *rig,
                      .key = request.key(),
                      .number = request.number(),
                      .attempt = request.attempt(),
                      .deleted = request.deleted(),
                      .records = request.records(),
                      .waiting = request.waiting(),
                      .program_version = request.program_version(),
                      .results = {}};
  for (const v1::InstructionResult& result : request.results()) {
    const auto name = ParseChildName(result.name(), "instructions");
    const auto number = name ? ParseCount(name->id) : std::nullopt;
    if (!number || name->rig != *rig) {
      return BadName("results.name", request.rig() + "/instructions/{n}");
    }
    report.results.push_back(
        {*number, result.refused(), SafeLine(result.message(), kMaxMessage)});
  }
  return report;
}

std::int64_t WorkOfReport(const v1::ReportRequest& request) {
  return ParsedSizeOfRecords(request.records());
}

absl::StatusOr<v1::ReportResponse> Report(const ApiContext& context,
                                          const Call&,
                                          const v1::ReportRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const DeviceReport report, ReadReport(request));
  const auto answer = context.pipeline->TakeReport(report);
  if (!answer.ok()) {
    return About(answer.status(), {kRigType, request.rig(), "records"});
  }
  v1::ReportResponse response;
  response.set_begin_anew(answer->begin_anew);
  response.set_attempt(answer->attempt);
  for (const StoredInstruction& instruction : answer->instructions) {
    SELFCAL_ASSIGN_OR_RETURN(*response.add_instructions(), Encode(instruction));
  }
  return response;
}

absl::StatusOr<v1::Instruction> CreateInstruction(
    const ApiContext& context,
    const Call& call,
    const v1::CreateInstructionRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  const Message* called = RequestOf(request.instruction());
  if (called == nullptr) {
    return InvalidFields({{"instruction", "has no request"}});
  }
  if (RigOf(*MethodOf(*called), *called) != *rig) {
    return InvalidFields(
        {{"instruction",
          "has a request that is not about " + request.parent()}});
  }
  const auto created = context.domain->CreateInstruction(
      *rig, call.caller.name, SerializeRequest(request.instruction()));
  if (!created.ok()) {
    return About(created.status(), {kRigType, request.parent(), "parent"});
  }
  return Encode(*created);
}

absl::StatusOr<v1::ListInstructionsResponse> ListInstructions(
    const ApiContext& context,
    const Call&,
    const v1::ListInstructionsRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  return FillPage<v1::ListInstructionsResponse>(
      request,
      request.parent(),
      [&](const Page& page) {
        return context.store->ListInstructions(*rig, page);
      },
      [](const StoredInstruction& instruction,
         v1::ListInstructionsResponse* to) -> absl::Status {
        SELFCAL_ASSIGN_OR_RETURN(*to->add_instructions(), Encode(instruction));
        return absl::OkStatus();
      });
}

}  // namespace

void AddUplinkMethods(Methods* methods) {
  methods->Add(Report, WorkOfReport);
  methods->Add(CreateInstruction);
  methods->Add(ListInstructions);
}

}  // namespace selfcal::server
