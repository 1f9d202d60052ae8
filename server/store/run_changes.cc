// The life of a run: pending -> running -> succeeded, failed or cancelled.
#include <fmt/format.h>

#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/clock.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

bool Unfinished(const StoredRun& run) {
  return run.state == RunState::kPending || run.state == RunState::kRunning;
}

absl::Status Ended(const StoredRun& run) {
  return absl::FailedPreconditionError(
      fmt::format("recalibration {} of rig {} has ended", run.run, run.rig));
}

absl::Status NotRunning(const StoredRun& run) {
  return absl::FailedPreconditionError(fmt::format(
      "recalibration {} of rig {} is not running", run.run, run.rig));
}

}  // namespace

absl::StatusOr<StoredRun> CreateManualRunRow(Connection* db,
                                             const std::string& rig_name) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           ReadTables(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run,
                           InsertRun(db, rig, tables, RunTrigger::kManual));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

absl::StatusOr<StoredRun> BeginRunRow(Connection* db,
                                      const std::string& rig,
                                      std::int64_t run_number) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig, run_number));
  if (!Unfinished(run)) {
    return Ended(run);
  }
  run.state = RunState::kRunning;
  ++run.attempts;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig_id, run));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

absl::StatusOr<StoredRun> ReleaseRunRow(Connection* db,
                                        const std::string& rig,
                                        std::int64_t run_number) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig, run_number));
  if (run.state != RunState::kRunning) {
    return NotRunning(run);
  }
  run.state = RunState::kPending;
  --run.attempts;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig_id, run));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

absl::StatusOr<StoredCalibration> FinishRunRow(
    Connection* db,
    const std::string& rig_name,
    std::int64_t run_number,
    const StoredCalibration& calibration) {
  if (calibration.state == CalibrationState::kSuperseded) {
    return absl::InvalidArgumentError(
        "a new calibration is active or rejected, not superseded");
  }
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig_name, run_number));
  if (run.state != RunState::kRunning) {
    return NotRunning(run);
  }
  StoredCalibration stored = calibration;
  SELFCAL_ASSIGN_OR_RETURN(stored.version, NextVersion(db, rig.rowid));
  stored.rig = rig_name;
  stored.create_time_ns = NowNs();
  stored.run = run.run;
  stored.base_version = run.base_version;
  stored.segments = run.segments;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change,
                           NewestChange(db, rig.rowid));
  if (run.change != change) {
    stored.state = CalibrationState::kRejected;
    stored.reasons.push_back(
        fmt::format("the device has changed (change {}) since its segments "
                    "were chosen",
                    change));
  }
  SELFCAL_RETURN_IF_ERROR(InsertCalibration(db, rig.rowid, stored));
  run.state = RunState::kSucceeded;
  run.end_time_ns = stored.create_time_ns;
  run.calibration_version = stored.version;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig.rowid, run));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           ReadTables(db, rig.rowid));
  SELFCAL_RETURN_IF_ERROR(MaybeInsertRun(db, rig, tables).status());
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig.rowid));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return stored;
}

absl::StatusOr<StoredRun> EndRunRow(Connection* db,
                                    const std::string& rig,
                                    std::int64_t run_number,
                                    RunState state,
                                    const std::string& message) {
  if (state != RunState::kFailed && state != RunState::kCancelled) {
    return absl::InvalidArgumentError(
        "a run without a calibration ends as failed or cancelled");
  }
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig, run_number));
  if (!Unfinished(run)) {
    return Ended(run);
  }
  run.state = state;
  run.message = message;
  run.end_time_ns = NowNs();
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig_id, run));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig_id));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

}  // namespace selfcal::server
