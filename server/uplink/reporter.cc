#include "server/uplink/reporter.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <utility>
#include <variant>

#include "proto/resource_names.h"
#include "server/api/call.h"
#include "server/domain/clock.h"
#include "server/encode/encode_instruction.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Records of about this size go into one report; the data of a segment may be
// larger.
constexpr std::int64_t kMaxReportBytes = std::int64_t{1} << 20;

// The hub, or the way to it, is out of order; other rigs need not be tried.
bool IsUnreachable(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) ||
         absl::IsCancelled(status);
}

std::chrono::steady_clock::duration Seconds(double seconds) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(seconds));
}

}  // namespace

absl::StatusOr<Reporter::Round> Reporter::ReportOnce(Time now,
                                                     const Pace& pace) {
  Outbox* const outbox = store_->outbox();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> unreported,
                           outbox->ListUnreported());
  for (const std::string& rig : unreported) {
    const absl::Status begun = outbox->BeginAnew(rig, options_.data);
    // It may be deleted meanwhile.
    if (!begun.ok() && !absl::IsNotFound(begun)) return begun;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<ReportedRig> rigs, outbox->List());
  Round round;
  for (const ReportedRig& rig : rigs) {
    Rig& known = rigs_[rig.key];
    const bool has_news =
        rig.waiting > 0 || rig.deleted || !known.results.empty();
    if (now < known.blocked || (!has_news && now < known.next)) {
      round.waiting += rig.waiting;
      if (now < known.blocked) round.refusal = known.refusal;
      continue;
    }
    const absl::Status status = ReportRig(rig, now, pace, &known, &round);
    if (IsUnreachable(status)) {
      round.status = status;
      return round;
    }
    SELFCAL_RETURN_IF_ERROR(status);
  }
  return round;
}

absl::Status Reporter::ReportRig(const ReportedRig& rig,
                                 Time now,
                                 const Pace& pace,
                                 Rig* known,
                                 Round* round) {
  Outbox* const outbox = store_->outbox();
  SELFCAL_ASSIGN_OR_RETURN(const Report report,
                           outbox->Next(rig, kMaxReportBytes));
  v1::ReportRequest request;
  request.set_rig(RigName(rig.rig));
  request.set_key(report.key);
  request.set_number(report.number);
  request.set_attempt(report.attempt);
  request.set_deleted(report.deleted);
  request.set_records(report.records);
  request.set_waiting(report.waiting);
  request.set_program_version(program_version_);
  for (const auto& [name, result] : known->results) {
    *request.add_results() = result;
  }
  // Also those of a report that fails: it may have reached the hub.
  const auto bytes = static_cast<std::int64_t>(request.ByteSizeLong());
  if (!pace(bytes)) return absl::CancelledError("the daemon is stopping");
  round->bytes += bytes;
  const auto response = hub_->Report(request);
  if (!response.ok()) {
    if (IsUnreachable(response.status())) return response.status();
    // Only this rig is refused.
    Block(fmt::format("the hub refuses the report of rig {}: {}",
                      rig.rig,
                      std::string(response.status().message())),
          now,
          known,
          round);
    round->waiting += rig.waiting;
    return absl::OkStatus();
  }
  known->next = now + Seconds(options_.interval_s);
  ++round->reports;
  if (response->attempt() > 0) {
    // The outbox was closed, or restored from a backup.
    round->waiting += rig.waiting;
    return outbox->FollowAttempt(rig, response->attempt());
  }
  if (response->begin_anew()) return BeginAnew(rig.rig, now, known, round);
  if (report.waiting == 0) known->begins_anew = false;
  if (!known->begins_anew) {
    known->refusal.clear();
    known->backoff.Reset();
  }
  known->results.clear();
  SELFCAL_RETURN_IF_ERROR(outbox->Confirm(report, NowNs()));
  round->waiting += report.waiting;
  if (report.deleted) {
    rigs_.erase(rig.key);
    return absl::OkStatus();
  }
  for (const v1::Instruction& instruction : response->instructions()) {
    known->results[instruction.name()] = CarryOut(rig.rig, instruction);
  }
  return absl::OkStatus();
}

absl::Status Reporter::BeginAnew(const std::string& rig,
                                 Time now,
                                 Rig* known,
                                 Round* round) {
  if (known->begins_anew) {
    Block(fmt::format("the hub asks again for all records of rig {}, before it "
                      "has them: some of them contradict what it has, or it "
                      "cannot write them",
                      rig),
          now,
          known,
          round);
  } else {
    spdlog::warn(
        "the hub does not have what was reported of rig {}: all records are "
        "reported again",
        rig);
  }
  known->begins_anew = true;
  const absl::Status begun = store_->outbox()->BeginAnew(rig, options_.data);
  return absl::IsNotFound(begun) ? absl::OkStatus() : begun;
}

void Reporter::Block(const std::string& refusal,
                     Time now,
                     Rig* known,
                     Round* round) {
  if (refusal != known->refusal) spdlog::error("{}", refusal);
  known->refusal = refusal;
  known->blocked = now + known->backoff.Next();
  round->refusal = refusal;
}

v1::InstructionResult Reporter::CarryOut(
    const std::string& rig, const v1::Instruction& instruction) const {
  v1::InstructionResult result;
  result.set_name(instruction.name());
  const auto refuse = [&](const std::string& why) {
    result.set_refused(true);
    result.set_message(why);
    spdlog::warn(
        "instruction {} of the hub is refused: {}", instruction.name(), why);
    return result;
  };
  const google::protobuf::Message* request = RequestOf(instruction);
  if (request == nullptr) {
    return refuse("this device does not know it: upgrade the device");
  }
  for (const Method& method : api_->methods()) {
    if (method.descriptor->input_type() != request->GetDescriptor()) continue;
    Call call;
    call.caller.name = PrintableName("hub/" + instruction.caller());
    call.caller.grants = {{options_.role, rig}};
    const std::unique_ptr<google::protobuf::Message> response(
        method.response->New());
    const auto* handler = std::get_if<UnaryHandler>(&method.handler);
    if (handler == nullptr) break;
    const absl::Status status = (*handler)(call, *request, response.get());
    if (!status.ok()) return refuse(std::string(status.message()));
    spdlog::info("instruction {} of the hub is carried out, for {}",
                 instruction.name(),
                 call.caller.name);
    return result;
  }
  return refuse("this device has no such method");
}

}  // namespace selfcal::server
