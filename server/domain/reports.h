// Reports that a hub takes from devices (server/store/outbox.h).
// A rig that a device reports belongs to the device: the hub has its records
// and changes none of them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "server/domain/domain_options.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Retention of the deletion of a rig by its device: longer than any report is
// on its way.
inline constexpr std::int64_t kEndOfReportsKept_ns =
    std::int64_t{7} * 24 * 3600 * 1'000'000'000;

// A report as it arrived.
struct DeviceReport {
  std::string rig = {};
  std::int64_t key = 0;      // of the rig in the database of the device
  std::int64_t number = 0;   // of the report, from 1; 1 begins anew
  std::int64_t attempt = 0;  // Report::attempt; 0: the device counts none
  bool deleted = false;      // the device has deleted the rig
  std::string records = {};  // Report::records
  std::int64_t waiting = 0;
  std::string program_version = {};
  // Result of an instruction that the device has carried out or refused.
  struct Result {
    std::int64_t instruction = 0;
    bool refused = false;
    std::string message;
  };
  std::vector<Result> results = {};
};

struct ReportAnswer {
  // The hub does not have what was reported before, e.g. since it was restored
  // from a backup: the device must report all records anew.
  bool begin_anew = false;
  // The report was rejected because this later attempt was accepted before; 0:
  // accepted.
  std::int64_t attempt = 0;
  std::vector<StoredInstruction> instructions;  // pending ones, oldest first
};

// OK unless a device reports the rig: then FAILED_PRECONDITION, which says so.
absl::Status CheckOwnRig(UnitOfWork* tx);

// Takes a report about a rig that exists. One with the number of the last is a
// repetition and is applied again; one that does not follow the last is not
// taken (ReportAnswer::begin_anew), nor is one of an older attempt
// (ReportAnswer::attempt). FAILED_PRECONDITION for one of another device, or
// about a rig of the hub's own.
absl::StatusOr<ReportAnswer> TakeReport(UnitOfWork* tx,
                                        const DeviceReport& report,
                                        const Quotas& quotas);
// Takes the first report of a rig that was inserted in this unit of work.
// ReportAnswer::attempt is set if it comes after the device has deleted the
// rig; the unit of work must not be committed then.
absl::StatusOr<ReportAnswer> TakeFirstReport(UnitOfWork* tx,
                                             const DeviceReport& report,
                                             const Quotas& quotas);

// Gives an instruction to the device of the rig. FAILED_PRECONDITION if none
// reports it, RESOURCE_EXHAUSTED if too many are pending.
absl::StatusOr<StoredInstruction> CreateInstruction(UnitOfWork* tx,
                                                    const std::string& caller,
                                                    const std::string& request);

}  // namespace selfcal::server
