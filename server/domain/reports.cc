#include "server/domain/reports.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "server/domain/alarms.h"
#include "server/domain/calibration_life.h"
#include "server/domain/quotas.h"
#include "server/status/status_macros.h"
#include "server/store/instructions.h"
#include "server/store/report.h"
#include "server/store/reporting_device.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

constexpr int kMaxInstructions = 20;  // in one answer
constexpr int kMaxPending = 1000;     // for one device

// `newest` is the newest attempt that was taken.
absl::Status Take(UnitOfWork* tx,
                  const DeviceReport& report,
                  std::int64_t newest,
                  const Quotas& quotas) {
  const auto make_room = [&](std::int64_t bytes) {
    return MakeRoomForReported(tx, bytes, quotas);
  };
  SELFCAL_RETURN_IF_ERROR(
      ApplyReport(tx, report.records, {make_room, StateOfReplaced}));
  SELFCAL_RETURN_IF_ERROR(
      WriteReportingDevice(tx,
                           {.key = report.key,
                            .report = report.number,
                            .attempt = std::max(newest, report.attempt),
                            .time_ns = tx->time_ns(),
                            .waiting = report.waiting,
                            .program_version = report.program_version}));
  return StoreAlarms(tx);
}

// Takes the last report of a rig, whatever was missed before.
absl::StatusOr<ReportAnswer> TakeDeletion(UnitOfWork* tx,
                                          const DeviceReport& report) {
  const auto no_room = [](std::int64_t) { return false; };
  SELFCAL_RETURN_IF_ERROR(
      ApplyReport(tx, report.records, {no_room, StateOfReplaced}));
  SELFCAL_RETURN_IF_ERROR(DeleteRigRows(tx));
  return ReportAnswer();
}

}  // namespace

absl::Status CheckOwnRig(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(tx));
  if (!device) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("rig {} is reported by its device: do this on the device; "
                  "this hub has a copy of its records",
                  tx->rig()));
}

absl::StatusOr<ReportAnswer> TakeReport(UnitOfWork* tx,
                                        const DeviceReport& report,
                                        const Quotas& quotas) {
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(tx));
  if (report.deleted) {
    // A rig of this name that is another's has nothing to do with it.
    const bool is_its = device && device->key == report.key;
    if (!is_its) return ReportAnswer();
    return TakeDeletion(tx, report);
  }
  if (!device) {
    return absl::FailedPreconditionError(fmt::format(
        "the hub has a rig {} of its own: give the rig of the device another "
        "name",
        tx->rig()));
  }
  if (device->key != report.key) {
    return absl::FailedPreconditionError(fmt::format(
        "another device, or an earlier rig, was reported as {}: give the rig "
        "another name or, if it replaces that one, delete {} at the hub first",
        tx->rig(),
        tx->rig()));
  }
  ReportAnswer answer;
  if (report.attempt != 0 && report.attempt < device->attempt) {
    // It comes late, and nobody waits for the answer; or the device does not
    // know its later attempts any more.
    answer.attempt = device->attempt;
    return answer;
  }
  const bool follows = report.number == 1 || report.number == device->report ||
                       report.number == device->report + 1;
  answer.begin_anew = !follows;
  if (!follows) return answer;
  SELFCAL_RETURN_IF_ERROR(Take(tx, report, device->attempt, quotas));
  for (const DeviceReport::Result& result : report.results) {
    SELFCAL_RETURN_IF_ERROR(EndInstruction(
        tx,
        result.instruction,
        result.refused ? InstructionState::kRefused : InstructionState::kDone,
        result.message));
  }
  SELFCAL_ASSIGN_OR_RETURN(answer.instructions,
                           PendingInstructions(tx, kMaxInstructions));
  return answer;
}

absl::StatusOr<ReportAnswer> TakeFirstReport(UnitOfWork* tx,
                                             const DeviceReport& report,
                                             const Quotas& quotas) {
  ReportAnswer answer;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t end,
                           ReadEndOfReports(tx, report.key));
  if (report.attempt != 0 && report.attempt < end) {
    answer.attempt = end;
    return answer;
  }
  SELFCAL_RETURN_IF_ERROR(ForgetEndOfReports(tx, report.key));
  SELFCAL_RETURN_IF_ERROR(CheckRigQuota(tx, quotas));
  SELFCAL_RETURN_IF_ERROR(Take(tx, report, 0, quotas));
  return answer;
}

absl::StatusOr<StoredInstruction> CreateInstruction(
    UnitOfWork* tx, const std::string& caller, const std::string& request) {
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(tx));
  if (!device) {
    return absl::FailedPreconditionError(fmt::format(
        "no device reports rig {}: make the call itself", tx->rig()));
  }
  SELFCAL_ASSIGN_OR_RETURN(const auto pending,
                           PendingInstructions(tx, kMaxPending));
  if (pending.size() == kMaxPending) {
    return absl::ResourceExhaustedError(fmt::format(
        "{} instructions for rig {} are pending; its device has not reported "
        "for too long",
        kMaxPending,
        tx->rig()));
  }
  return InsertInstruction(tx, caller, request);
}

}  // namespace selfcal::server
