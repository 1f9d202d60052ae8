// Executes one run from beginning to end, on the thread of the Recalibrator.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "server/pipeline/backoff.h"
#include "server/pipeline/recalibration.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

Recalibrator::Execution Recalibrator::Execute(const StoredRun& pending) {
  if (pending.attempts >= kMaxAttempts) {
    return GiveUp(pending) ? Execution::kDone : Execution::kTryLater;
  }
  const auto hold = HoldReason(pending);
  if (!hold.ok()) {
    spdlog::error("cannot tell whether run {} of rig {} may begin: {}",
                  pending.run,
                  pending.rig,
                  hold.status().ToString());
    return Execution::kTryLater;
  }
  if (pending.state == RunState::kPending && !hold->empty()) {
    return Hold(pending, *hold);
  }
  absl::StatusOr<StoredRun> begun = absl::UnknownError("");
  {
    const std::lock_guard lock(mutex_);
    if (!running_) {
      return Execution::kDone;
    }
    begun = domain_->BeginRun(pending.rig, pending.run);
    if (begun.ok()) {
      current_ = Current{pending.rig, pending.run, false, {}};
    }
  }
  if (!begun.ok()) {
    // A run that was cancelled meanwhile is done.
    spdlog::warn("cannot begin run {} of rig {}: {}",
                 pending.run,
                 pending.rig,
                 begun.status().ToString());
    return absl::IsFailedPrecondition(begun.status()) ? Execution::kDone
                                                      : Execution::kTryLater;
  }
  return ExecuteBegun(*begun);
}

Recalibrator::Execution Recalibrator::ExecuteBegun(const StoredRun& run) {
  run_watchers_->Publish(RunTopic(run.rig, run.run), {run, {}});
  const absl::Status status = Conclude(run, Solve(run));
  if (!status.ok()) {
    spdlog::error("cannot store the end of run {} of rig {}: {}",
                  run.run,
                  run.rig,
                  status.ToString());
  }
  {
    const std::lock_guard lock(mutex_);
    current_.reset();
  }
  changed_.notify_all();
  return status.ok() ? Execution::kDone : Execution::kTryLater;
}

Recalibrator::Execution Recalibrator::Hold(const StoredRun& run,
                                           const std::string& reason) {
  if (run.message == reason) {
    return Execution::kDeferred;
  }
  const absl::Status held = domain_->HoldRun(run.rig, run.run, reason);
  if (!held.ok()) {
    // A run that was cancelled meanwhile is done.
    return absl::IsFailedPrecondition(held) ? Execution::kDone
                                            : Execution::kTryLater;
  }
  spdlog::info("run {} of rig {} is deferred: {}", run.run, run.rig, reason);
  StoredRun now = run;
  now.message = reason;
  run_watchers_->Publish(RunTopic(run.rig, run.run), {now, {}});
  return Execution::kDeferred;
}

bool Recalibrator::GiveUp(const StoredRun& run) {
  return End(run,
             RunState::kFailed,
             fmt::format("the daemon ended {} times during this run; it is not "
                         "started again",
                         run.attempts))
      .ok();
}

Recalibrator::Outcome Recalibrator::Solve(const StoredRun& run) {
  Outcome outcome;
  try {
    absl::StatusOr<StoredCalibration> candidate =
        EnsureCandidate(run, &outcome.damaged);
    outcome.status = candidate.status();
    if (candidate.ok()) {
      outcome.candidate = *std::move(candidate);
    }
  } catch (const std::exception& error) {
    outcome.status = absl::InternalError(
        fmt::format("the solver broke off: {}", error.what()));
  }
  return outcome;
}

absl::Status Recalibrator::Conclude(const StoredRun& run,
                                    const Outcome& outcome) {
  if (Cancelled()) {
    return End(run, RunState::kCancelled, "cancelled on request");
  }
  if (outcome.candidate) {
    return Succeed(run, *outcome.candidate);
  }
  if (absl::IsCancelled(outcome.status) || IsTransient(outcome.status)) {
    // A stop, or the disk: the run is released and starts again later.
    SELFCAL_RETURN_IF_ERROR(domain_->ReleaseRun(run.rig, run.run).status());
    return IsTransient(outcome.status) ? outcome.status : absl::OkStatus();
  }
  const std::string message(outcome.status.message());
  SELFCAL_RETURN_IF_ERROR(End(run, RunState::kFailed, message));
  return outcome.damaged
             ? domain_->MarkUnusable(run.rig, *outcome.damaged, message)
             : absl::OkStatus();
}

absl::Status Recalibrator::Succeed(const StoredRun& run,
                                   const StoredCalibration& candidate) {
  const auto finished = Retry([&] { return Finish(run, candidate); });
  if (IsTransient(finished.status())) {
    return finished.status();
  }
  if (!finished.ok()) {
    return End(
        run, RunState::kFailed, std::string(finished.status().message()));
  }
  const StoredCalibration& stored = *finished;
  if (stored.state == CalibrationState::kActive) {
    spdlog::info("rig {} has calibration {}", stored.rig, stored.version);
    calibration_watchers_->Publish(stored.rig, stored);
  } else {
    spdlog::warn("calibration {} of rig {} is rejected: {}",
                 stored.version,
                 stored.rig,
                 fmt::join(stored.reasons, " "));
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun ended,
                           store_->GetRun(run.rig, run.run));
  TellEnd(ended);
  return absl::OkStatus();
}

absl::Status Recalibrator::End(const StoredRun& run,
                               RunState state,
                               const std::string& message) {
  spdlog::warn("run {} of rig {} ends without a calibration: {}",
               run.run,
               run.rig,
               message);
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun ended,
                           domain_->EndRun(run.rig, run.run, state, message));
  TellEnd(ended);
  return absl::OkStatus();
}

}  // namespace selfcal::server
