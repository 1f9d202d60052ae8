// One run from its beginning to its end, on the thread of the Recalibrator.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <utility>

#include "server/pipeline/after_change.h"
#include "server/pipeline/candidate.h"
#include "server/pipeline/recalibration.h"
#include "server/pipeline/retry.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

bool Recalibrator::Execute(const StoredRun& pending) {
  absl::StatusOr<StoredRun> begun = absl::UnknownError("");
  {
    const std::lock_guard lock(mutex_);
    if (!running_) {
      return true;
    }
    if (pending.attempts < kMaxAttempts) {
      begun = store_->BeginRun(pending.rig, pending.run);
      if (begun.ok()) {
        current_ = Current{pending.rig, pending.run, false, {}};
      }
    }
  }
  if (pending.attempts >= kMaxAttempts) {
    return GiveUp(pending);
  }
  if (!begun.ok()) {
    // One that was cancelled meanwhile is done.
    spdlog::warn("cannot begin run {} of rig {}: {}",
                 pending.run,
                 pending.rig,
                 begun.status().ToString());
    return absl::IsFailedPrecondition(begun.status());
  }
  run_watchers_->Publish(RunTopic(begun->rig, begun->run), {*begun, {}});
  const Outcome outcome = Solve(*begun);
  absl::Status status = Conclude(*begun, outcome);
  if (!status.ok()) {
    spdlog::error("cannot store the end of run {} of rig {}: {}",
                  begun->run,
                  begun->rig,
                  status.ToString());
  }
  {
    const std::lock_guard lock(mutex_);
    current_.reset();
  }
  changed_.notify_all();
  return status.ok();
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
  const auto start = std::chrono::steady_clock::now();
  Outcome outcome;
  try {
    absl::StatusOr<StoredCalibration> candidate =
        FindCandidate(run, &outcome.damaged);
    outcome.status = candidate.status();
    if (candidate.ok()) {
      candidate->seconds = std::chrono::duration<double>(
                               std::chrono::steady_clock::now() - start)
                               .count();
      outcome.calibration = *std::move(candidate);
    }
  } catch (const std::exception& error) {
    outcome.status = absl::InternalError(
        fmt::format("the solver broke off: {}", error.what()));
  }
  return outcome;
}

absl::StatusOr<StoredCalibration> Recalibrator::FindCandidate(
    const StoredRun& run, std::optional<SegmentKey>* damaged) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(run.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration base,
                           store_->GetCalibration(run.rig, run.base_version));
  std::vector<MotionSegment> segments;
  SELFCAL_RETURN_IF_ERROR(LoadSegments(run, &segments, damaged));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration active,
                           store_->GetActiveCalibration(run.rig));
  CalibrateOptions options = options_.calibrate;
  options.reweight_noise |= rig.rig.reweight_noise;
  if (run.change > 0) {
    SELFCAL_ASSIGN_OR_RETURN(const StoredChange change,
                             store_->GetChange(run.rig, run.change));
    SELFCAL_ASSIGN_OR_RETURN(
        const StoredCalibration before,
        store_->GetCalibration(run.rig, change.base_version));
    options.prior = KnownAfter(rig.rig, change, before);
    if (active.version == change.base_version) {
      active.covariance = CovarianceAfter(rig.rig, change, active.covariance);
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(
      CalibrationResult result,
      RunSolver(run, rig.rig, base.theta, segments, options));
  StoredCalibration candidate;
  candidate.reasons = CandidateProblems(rig.rig, active, result);
  candidate.state = candidate.reasons.empty() ? CalibrationState::kActive
                                              : CalibrationState::kRejected;
  candidate.theta = result.theta;
  candidate.covariance = result.covariance;
  candidate.program_version = options_.program_version;
  candidate.report = std::move(result);
  return candidate;
}

absl::Status Recalibrator::LoadSegments(const StoredRun& run,
                                        std::vector<MotionSegment>* segments,
                                        std::optional<SegmentKey>* damaged) {
  for (const SegmentKey& key : run.segments) {
    if (Interrupted()) {
      return absl::CancelledError("interrupted");
    }
    auto segment = store_->GetSegmentData(run.rig, key);
    if (absl::IsDataLoss(segment.status())) {
      *damaged = key;
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    segments->push_back(*std::move(segment));
  }
  return absl::OkStatus();
}

absl::StatusOr<CalibrationResult> Recalibrator::RunSolver(
    const StoredRun& run,
    const Rig& rig,
    const Calibration& start,
    const std::vector<MotionSegment>& segments,
    const CalibrateOptions& options) {
  CalibrationResult result = estimators_.calibrate(
      rig, start, segments, options, [&](const CalibrateProgress& progress) {
        return Report(run, progress);
      });
  if (result.status == CalibrateStatus::kCancelled) {
    return absl::CancelledError("interrupted");
  }
  if (result.status == CalibrateStatus::kFailed) {
    return absl::InternalError(
        fmt::format("the solver failed: {}", result.message));
  }
  return result;
}

bool Recalibrator::Report(const StoredRun& run,
                          const CalibrateProgress& progress) {
  {
    const std::lock_guard lock(mutex_);
    current_->progress = progress;
  }
  run_watchers_->Publish(RunTopic(run.rig, run.run), {run, progress});
  return !Interrupted();
}

absl::Status Recalibrator::Conclude(const StoredRun& run,
                                    const Outcome& outcome) {
  if (Cancelled()) {
    return End(run, RunState::kCancelled, "cancelled on request");
  }
  if (outcome.calibration) {
    return Succeed(run, *outcome.calibration);
  }
  if (absl::IsCancelled(outcome.status) || IsTransient(outcome.status)) {
    // A stop, or the disk: the run goes back, and starts again later.
    SELFCAL_RETURN_IF_ERROR(store_->ReleaseRun(run.rig, run.run).status());
    return IsTransient(outcome.status) ? outcome.status : absl::OkStatus();
  }
  const std::string message(outcome.status.message());
  SELFCAL_RETURN_IF_ERROR(End(run, RunState::kFailed, message));
  return outcome.damaged
             ? store_->MarkUnusable(run.rig, *outcome.damaged, message)
             : absl::OkStatus();
}

absl::Status Recalibrator::Succeed(const StoredRun& run,
                                   const StoredCalibration& calibration) {
  // A result that took minutes is not thrown away for a full disk.
  Backoff backoff;
  auto finished = store_->FinishRun(run.rig, run.run, calibration);
  while (IsTransient(finished.status()) && Pause(backoff.Next())) {
    finished = store_->FinishRun(run.rig, run.run, calibration);
  }
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
                 fmt::join(stored.reasons, "; "));
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun ended,
                           store_->GetRun(run.rig, run.run));
  run_watchers_->Publish(RunTopic(run.rig, run.run),
                         {ended, ProgressOf(run.rig, run.run)});
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
                           store_->EndRun(run.rig, run.run, state, message));
  run_watchers_->Publish(RunTopic(run.rig, run.run),
                         {ended, ProgressOf(run.rig, run.run)});
  return absl::OkStatus();
}

}  // namespace selfcal::server
