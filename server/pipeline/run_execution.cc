#include "server/pipeline/run_execution.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "server/domain/run_interval.h"
#include "server/pipeline/backoff.h"
#include "server/pipeline/run_candidate.h"
#include "server/pipeline/run_validation.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// A candidate, or why there is none.
struct Outcome {
  absl::Status status;
  std::optional<StoredCalibration> candidate;
  std::optional<SegmentKey> damaged;
};

// A run that has ended meanwhile is done, and so is one that another daemon
// executes.
Execution AfterFailure(const absl::Status& failure) {
  return absl::IsFailedPrecondition(failure) || IsClaimLost(failure)
             ? Execution::kDone
             : Execution::kTryLater;
}

// Why the run does not begin yet; empty if it may.
absl::StatusOr<std::string> DeferReason(const RunContext& context,
                                        const StoredRun& run) {
  if (run.trigger == RunTrigger::kManual) {
    return "";
  }
  SELFCAL_ASSIGN_OR_RETURN(
      std::string interval,
      IntervalReason(context.store(), run, context.options.now_ns()));
  if (!interval.empty()) return interval;
  Conditions* const conditions = context.options.conditions;
  return conditions == nullptr ? "" : conditions->DeferReason();
}

Execution Defer(const RunContext& context,
                const StoredRun& run,
                const std::string& reason) {
  if (run.message == reason) {
    return Execution::kDeferred;
  }
  const absl::Status deferred =
      context.domain->DeferRun(context.claim, run.run, reason);
  if (!deferred.ok()) return AfterFailure(deferred);
  spdlog::info("run {} of rig {} is deferred: {}", run.run, run.rig, reason);
  StoredRun now = run;
  now.message = reason;
  PublishRun(context, now);
  return Execution::kDeferred;
}

// Publishes the end of a run with its last iteration.
void PublishEnd(const RunContext& context, const StoredRun& ended) {
  const auto steps = context.current->StepsOf(ended.rig, ended.run);
  PublishStep(
      context, ended, steps.empty() ? CalibrateProgress() : steps.back());
}

absl::Status EndWithout(const RunContext& context,
                        const StoredRun& run,
                        RunState state,
                        const std::string& message) {
  spdlog::warn("run {} of rig {} ends without a calibration: {}",
               run.run,
               run.rig,
               message);
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredRun ended,
      context.domain->EndRun(context.claim, run.run, state, message));
  PublishEnd(context, ended);
  return absl::OkStatus();
}

Outcome Solve(const RunContext& context, const StoredRun& run) {
  Outcome outcome;
  try {
    absl::StatusOr<StoredCalibration> candidate =
        EnsureCandidate(context, run, &outcome.damaged);
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

absl::Status EndWith(const RunContext& context,
                     Watchers<StoredCalibration>* calibration_watchers,
                     const StoredRun& run,
                     const StoredCalibration& candidate) {
  const auto finished = RetryUnlessInterrupted(context.current, [&] {
    return ValidateAndFinish(context, run, candidate);
  });
  if (IsTransient(finished.status())) {
    return finished.status();
  }
  if (!finished.ok()) {
    return EndWithout(context,
                      run,
                      RunState::kFailed,
                      std::string(finished.status().message()));
  }
  const StoredCalibration& stored = *finished;
  if (stored.state == CalibrationState::kActive) {
    spdlog::info("rig {} has calibration {}", stored.rig, stored.version);
    calibration_watchers->Publish(stored);
  } else {
    spdlog::warn("calibration {} of rig {} is rejected: {}",
                 stored.version,
                 stored.rig,
                 fmt::join(stored.reasons, " "));
    // The run may have found that the version that stays active is not to be
    // trusted.
    SELFCAL_ASSIGN_OR_RETURN(StoredCalibration active,
                             context.store()->GetActiveCalibration(run.rig));
    calibration_watchers->Publish(std::move(active));
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun ended,
                           context.store()->GetRun(run.rig, run.run));
  PublishEnd(context, ended);
  return absl::OkStatus();
}

absl::Status Conclude(const RunContext& context,
                      Watchers<StoredCalibration>* calibration_watchers,
                      const StoredRun& run,
                      const Outcome& outcome) {
  if (context.current->cancelled()) {
    return EndWithout(
        context, run, RunState::kCancelled, "cancelled on request");
  }
  if (outcome.candidate) {
    return EndWith(context, calibration_watchers, run, *outcome.candidate);
  }
  if (absl::IsCancelled(outcome.status) || IsTransient(outcome.status)) {
    // A stop, or the disk: the run is released and starts again later.
    SELFCAL_RETURN_IF_ERROR(
        context.domain->ReleaseRun(context.claim, run.run).status());
    return IsTransient(outcome.status) ? outcome.status : absl::OkStatus();
  }
  const std::string message(outcome.status.message());
  SELFCAL_RETURN_IF_ERROR(EndWithout(context, run, RunState::kFailed, message));
  return outcome.damaged ? context.domain->MarkUnusable(
                               context.claim, *outcome.damaged, message)
                         : absl::OkStatus();
}

}  // namespace

Execution ExecuteRun(const RunContext& context,
                     Watchers<StoredCalibration>* calibration_watchers,
                     const StoredRun& pending) {
  if (pending.attempts >= kMaxRunAttempts) {
    const absl::Status ended =
        EndWithout(context,
                   pending,
                   RunState::kFailed,
                   fmt::format("the daemon ended {} times during this run; it "
                               "is not started again",
                               pending.attempts));
    return ended.ok() ? Execution::kDone : AfterFailure(ended);
  }
  const auto hold = DeferReason(context, pending);
  if (!hold.ok()) {
    spdlog::error("cannot tell whether run {} of rig {} may begin: {}",
                  pending.run,
                  pending.rig,
                  hold.status().ToString());
    return Execution::kTryLater;
  }
  if (pending.state == RunState::kPending && !hold->empty()) {
    return Defer(context, pending, *hold);
  }
  const auto begun = context.current->Begin(
      [&] { return context.domain->BeginRun(context.claim, pending.run); });
  if (!begun) return Execution::kDone;
  if (!begun->ok()) {
    spdlog::warn("cannot begin run {} of rig {}: {}",
                 pending.run,
                 pending.rig,
                 begun->status().ToString());
    return AfterFailure(begun->status());
  }
  const StoredRun& run = **begun;
  PublishRun(context, run);
  const absl::Status status =
      Conclude(context, calibration_watchers, run, Solve(context, run));
  context.current->End();
  if (status.ok()) return Execution::kDone;
  spdlog::warn("run {} of rig {} does not end here: {}",
               run.run,
               run.rig,
               status.ToString());
  return AfterFailure(status);
}

}  // namespace selfcal::server
