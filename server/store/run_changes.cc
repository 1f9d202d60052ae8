// The life of a run: pending -> running -> succeeded, failed or cancelled.
#include <fmt/format.h>

#include "server/store/calibrations.h"
#include "server/store/changes.h"
#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"

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

// That of a run that ends without a calibration.
absl::Status RejectCandidate(Connection* db,
                             std::int64_t rig,
                             const StoredRun& run) {
  SELFCAL_ASSIGN_OR_RETURN(const auto version,
                           CandidateOfRun(db, rig, run.run));
  if (!version) {
    return absl::OkStatus();
  }
  StoredCalibration judged;
  judged.rig = run.rig;
  judged.version = *version;
  judged.state = CalibrationState::kRejected;
  judged.reasons = {
      fmt::format("Its run ended before it was validated: {}.", run.message)};
  return JudgeCandidate(db, rig, judged);
}

}  // namespace

absl::Status HoldRunRow(Connection* db,
                        const std::string& rig,
                        std::int64_t run_number,
                        const std::string& reason) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(db, rig, run_number));
  if (run.state != RunState::kPending) {
    return absl::FailedPreconditionError(fmt::format(
        "recalibration {} of rig {} does not wait", run_number, rig));
  }
  if (run.message == reason) {
    return absl::OkStatus();
  }
  if (run.message.empty()) {
    SELFCAL_RETURN_IF_ERROR(
        AppendEvent(db,
                    rig,
                    EventKind::kRunHeldBack,
                    fmt::format("run {} is held back: {}", run.run, reason)));
  }
  run.message = reason;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig_id, run));
  return transaction.Commit();
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
  run.message.clear();
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
  SELFCAL_RETURN_IF_ERROR(RejectCandidate(db, rig_id, run));
  SELFCAL_RETURN_IF_ERROR(UpdateRun(db, rig_id, run));
  SELFCAL_RETURN_IF_ERROR(DropUnreferencedPayloads(db, rig_id));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

}  // namespace selfcal::server
