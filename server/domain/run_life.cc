#include "server/domain/run_life.h"

#include <fmt/format.h>

#include "server/domain/calibration_life.h"
#include "server/domain/outdated_scores.h"
#include "server/domain/retention.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/events.h"
#include "server/store/runs.h"

namespace selfcal::server {
namespace {

bool Unfinished(const StoredRun& run) {
  return run.state == RunState::kPending || run.state == RunState::kRunning;
}

absl::Status Ended(const StoredRun& run) {
  return absl::FailedPreconditionError(
      fmt::format("recalibration {} of rig {} has ended", run.run, run.rig));
}

// Rejects the candidate of a run that ends without a calibration.
absl::Status RejectCandidate(UnitOfWork* tx, const StoredRun& run) {
  SELFCAL_ASSIGN_OR_RETURN(const auto version, CandidateOfRun(tx, run.run));
  if (!version) {
    return absl::OkStatus();
  }
  StoredCalibration rejected;
  rejected.rig = run.rig;
  rejected.version = *version;
  rejected.state = CalibrationState::kRejected;
  rejected.reasons = {
      fmt::format("Its run ended before it was validated: {}.", run.message)};
  return EndValidation(tx, rejected);
}

std::string EndText(const StoredRun& run) {
  switch (run.state) {
    case RunState::kSucceeded:
      return fmt::format(
          "run {} produced version {}", run.run, run.calibration_version);
    case RunState::kCancelled:
      return fmt::format("run {} was cancelled: {}", run.run, run.message);
    default:
      return fmt::format("run {} failed: {}", run.run, run.message);
  }
}

}  // namespace

absl::Status DeferRun(UnitOfWork* tx,
                      std::int64_t run_number,
                      const std::string& reason) {
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(tx, run_number));
  if (run.state != RunState::kPending) {
    return absl::FailedPreconditionError(fmt::format(
        "recalibration {} of rig {} does not wait", run_number, tx->rig()));
  }
  if (run.message == reason) {
    return absl::OkStatus();
  }
  if (run.message.empty()) {
    SELFCAL_RETURN_IF_ERROR(
        AppendEvent(tx,
                    EventKind::kRunDeferred,
                    fmt::format("run {} is deferred: {}", run.run, reason)));
  }
  run.message = reason;
  return UpdateRun(tx, run);
}

absl::StatusOr<StoredRun> BeginRun(UnitOfWork* tx, std::int64_t run_number) {
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(tx, run_number));
  if (!Unfinished(run)) {
    return Ended(run);
  }
  run.state = RunState::kRunning;
  run.message.clear();
  ++run.attempts;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(tx, run));
  return run;
}

absl::StatusOr<StoredRun> ReleaseRun(UnitOfWork* tx, std::int64_t run_number) {
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRunningRun(tx, run_number));
  run.state = RunState::kPending;
  --run.attempts;
  SELFCAL_RETURN_IF_ERROR(UpdateRun(tx, run));
  SELFCAL_RETURN_IF_ERROR(EndCandidateScores(tx));
  return run;
}

absl::StatusOr<StoredRun> ReadRunningRun(UnitOfWork* tx,
                                         std::int64_t run_number) {
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(tx, run_number));
  if (run.state != RunState::kRunning) {
    return absl::FailedPreconditionError(fmt::format(
        "recalibration {} of rig {} is not running", run_number, tx->rig()));
  }
  return run;
}

absl::Status WriteEnd(UnitOfWork* tx, const StoredRun& run) {
  SELFCAL_RETURN_IF_ERROR(UpdateRun(tx, run));
  SELFCAL_RETURN_IF_ERROR(EndCandidateScores(tx));
  return AppendEvent(tx, EventKind::kRunEnded, EndText(run));
}

absl::StatusOr<StoredRun> EndRun(UnitOfWork* tx,
                                 std::int64_t run_number,
                                 RunState state,
                                 const std::string& message) {
  if (state != RunState::kFailed && state != RunState::kCancelled) {
    return absl::InvalidArgumentError(
        "a run without a calibration ends as failed or cancelled");
  }
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRun(tx, run_number));
  if (!Unfinished(run)) {
    return Ended(run);
  }
  run.state = state;
  run.message = message;
  run.end_time_ns = tx->time_ns();
  run.end_steady_ns = tx->now().steady_ns;
  SELFCAL_RETURN_IF_ERROR(RejectCandidate(tx, run));
  SELFCAL_RETURN_IF_ERROR(WriteEnd(tx, run));
  SELFCAL_RETURN_IF_ERROR(DropUnneededData(tx));
  return run;
}

}  // namespace selfcal::server
