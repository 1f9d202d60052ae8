// What a run ends with: its calibration, a candidate first, then judged.
#include <fmt/format.h>

#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/clock.h"
#include "server/store/quarantine.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

absl::StatusOr<StoredRun> ReadRunningRun(Connection* db,
                                         const std::string& rig,
                                         std::int64_t number) {
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig, number));
  if (run.state != RunState::kRunning) {
    return absl::FailedPreconditionError(
        fmt::format("recalibration {} of rig {} is not running", number, rig));
  }
  return run;
}

// The candidate of the run: the one that it has, or a new one.
absl::StatusOr<StoredCalibration> EnsureCandidate(
    Connection* db,
    std::int64_t rig,
    const StoredRun& run,
    const StoredCalibration& calibration) {
  SELFCAL_ASSIGN_OR_RETURN(const auto version,
                           CandidateOfRun(db, rig, run.run));
  if (version) {
    return ReadCalibration(db, run.rig, *version);
  }
  StoredCalibration stored = calibration;
  SELFCAL_ASSIGN_OR_RETURN(stored.version, NextVersion(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(stored.schema_version,
                           ReadInt(db, "PRAGMA user_version"));
  stored.rig = run.rig;
  stored.state = CalibrationState::kCandidate;
  stored.create_time_ns = NowNs();
  stored.run = run.run;
  stored.base_version = run.base_version;
  stored.segments = run.segments;
  stored.reasons.clear();
  stored.validation.reset();
  SELFCAL_RETURN_IF_ERROR(InsertCalibration(db, rig, stored));
  return stored;
}

// It was compared with the version that is active now.
absl::Status CheckValidation(Connection* db,
                             std::int64_t rig,
                             const StoredCalibration& calibration) {
  if (!calibration.validation) {
    return absl::OkStatus();
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(db, rig));
  if (calibration.validation->active_version != active) {
    return absl::AbortedError(
        fmt::format("it was validated against version {}, but {} is active now",
                    calibration.validation->active_version,
                    active));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<StoredCalibration> StoreCandidateRow(
    Connection* db,
    const std::string& rig,
    std::int64_t run_number,
    const StoredCalibration& calibration) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                           ReadRunningRun(db, rig, run_number));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration stored,
                           EnsureCandidate(db, rig_id, run, calibration));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return stored;
}

absl::StatusOr<StoredCalibration> ReadCandidate(Connection* db,
                                                const std::string& rig,
                                                std::int64_t run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const auto version, CandidateOfRun(db, rig_id, run));
  if (!version) {
    return absl::NotFoundError(
        fmt::format("recalibration {} of rig {} has no candidate", run, rig));
  }
  return ReadCalibration(db, rig, *version);
}

absl::StatusOr<StoredCalibration> FinishRunRow(
    Connection* db,
    const std::string& rig_name,
    std::int64_t run_number,
    const StoredCalibration& calibration,
    const ChangeOptions& change_options) {
  if (calibration.state != CalibrationState::kActive &&
      calibration.state != CalibrationState::kRejected) {
    return absl::InvalidArgumentError(
        "a run ends with a calibration that is active or rejected");
  }
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run,
                           ReadRunningRun(db, rig_name, run_number));
  SELFCAL_RETURN_IF_ERROR(CheckValidation(db, rig.rowid, calibration));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration judged,
                           EnsureCandidate(db, rig.rowid, run, calibration));
  judged.state = calibration.state;
  judged.reasons = calibration.reasons;
  judged.validation = calibration.validation;
  judged.verdict = calibration.verdict;
  SELFCAL_ASSIGN_OR_RETURN(
      const auto split, MaybeInsertSplit(db, rig, run, judged, change_options));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change,
                           NewestChange(db, rig.rowid));
  // The result accounts for a change among its own segments: its theta is that
  // of the newest of them.
  if (!split && run.change != change) {
    judged.state = CalibrationState::kRejected;
    judged.reasons.push_back(
        fmt::format("The device has changed (change {}) since its segments "
                    "were chosen: the next run is on segments after that.",
                    change));
  }
  SELFCAL_ASSIGN_OR_RETURN(const auto unusable,
                           UnusableSegments(db, rig.rowid, run.run));
  if (!unusable.empty()) {
    judged.state = CalibrationState::kRejected;
    judged.reasons.push_back(
        fmt::format("{} became unusable since its segments were chosen",
                    SegmentText(rig_name, unusable.front())));
  }
  SELFCAL_RETURN_IF_ERROR(JudgeCandidate(db, rig.rowid, judged));
  // Segments of a changed device contradict each other, and none is wrong.
  if (judged.state == CalibrationState::kActive && calibration.report &&
      !split) {
    SELFCAL_RETURN_IF_ERROR(QuarantineExcluded(
        db, rig.rowid, run, calibration.report->segment_fits));
  }
  run.state = RunState::kSucceeded;
  run.end_time_ns = NowNs();
  run.calibration_version = judged.version;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig.rowid, run));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           ReadFreshTables(db, rig, NowNs()));
  SELFCAL_RETURN_IF_ERROR(MaybeInsertRun(db, rig, tables).status());
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration stored,
                           ReadCalibration(db, rig_name, judged.version));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return stored;
}

}  // namespace selfcal::server
