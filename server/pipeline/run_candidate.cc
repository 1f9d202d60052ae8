// Computation of the candidate of a run.
#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "server/pipeline/recalibration.h"
#include "server/pipeline/run_options.h"
#include "server/pipeline/run_settings.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<StoredCalibration> Recalibrator::EnsureCandidate(
    const StoredRun& run, std::optional<SegmentKey>* damaged) {
  auto stored = store_->GetCandidate(run.rig, run.run);
  if (!absl::IsNotFound(stored.status())) {
    return stored;
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration found,
                           FindCandidate(run, damaged));
  return Retry(
      [&] { return domain_->StoreCandidate(run.rig, run.run, found); });
}

absl::StatusOr<StoredCalibration> Recalibrator::FindCandidate(
    const StoredRun& run, std::optional<SegmentKey>* damaged) {
  const auto begin = std::chrono::steady_clock::now();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(run.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration base,
                           store_->GetCalibration(run.rig, run.base_version));
  std::vector<MotionSegment> segments;
  SELFCAL_RETURN_IF_ERROR(LoadSegments(run, &segments, damaged));
  SELFCAL_ASSIGN_OR_RETURN(const CalibrateOptions options,
                           OptionsOfRun(domain_, options_.calibrate, rig, run));
  SELFCAL_ASSIGN_OR_RETURN(
      CalibrationResult result,
      RunSolver(run, rig.rig, base.theta, segments, options));
  StoredCalibration candidate;
  candidate.state = CalibrationState::kCandidate;
  candidate.theta = result.theta;
  candidate.covariance = result.covariance;
  candidate.program_version = options_.program_version;
  candidate.settings = RunSettings(options, run.change);
  candidate.report = std::move(result);
  candidate.steps = StepsOf(run.rig, run.run);
  candidate.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
          .count();
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
  const auto deadline =
      std::chrono::steady_clock::now() + options_.max_run_time;
  const auto late = [&] { return std::chrono::steady_clock::now() > deadline; };
  const auto unwanted = [&] { return Interrupted() || late(); };
  CalibrationResult result = estimators_.calibrate(
      rig,
      start,
      segments,
      options,
      [&](const CalibrateProgress& progress) {
        Report(run, progress);
        return !unwanted();
      },
      unwanted);
  if (result.status == CalibrateStatus::kCancelled && late() &&
      !Interrupted()) {
    return absl::DeadlineExceededError(fmt::format(
        "it took longer than the {:g} s that a run may; smaller tables make it "
        "shorter",
        std::chrono::duration<double>(options_.max_run_time).count()));
  }
  if (result.status == CalibrateStatus::kCancelled) {
    return absl::CancelledError("interrupted");
  }
  if (result.status == CalibrateStatus::kFailed) {
    return absl::InternalError(
        fmt::format("the solver failed: {}", result.message));
  }
  return result;
}

void Recalibrator::Report(const StoredRun& run,
                          const CalibrateProgress& progress) {
  {
    const std::lock_guard lock(mutex_);
    auto& steps = current_->steps;
    if (steps.empty() || steps.back().iteration < progress.iteration) {
      steps.push_back(progress);
    }
  }
  run_watchers_->Publish(RunTopic(run.rig, run.run), {run, progress});
}

void Recalibrator::TellEnd(const StoredRun& ended) {
  const auto steps = StepsOf(ended.rig, ended.run);
  run_watchers_->Publish(
      RunTopic(ended.rig, ended.run),
      {ended, steps.empty() ? CalibrateProgress() : steps.back()});
}

}  // namespace selfcal::server
