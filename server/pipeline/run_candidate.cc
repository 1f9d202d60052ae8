#include "server/pipeline/run_candidate.h"

#include <fmt/format.h>

#include <chrono>
#include <optional>
#include <utility>

#include "core/population/prior_start.h"
#include "server/pipeline/run_options.h"
#include "server/pipeline/run_settings.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

SegmentSource SegmentsOf(const RunContext& context,
                         const StoredRun& run,
                         std::optional<SegmentKey>* damaged) {
  return [&context, &run, damaged, next = run.segments.begin()]() mutable
         -> absl::StatusOr<std::optional<MotionSegment>> {
    if (next == run.segments.end()) return std::nullopt;
    if (context.interrupted()) return absl::CancelledError("interrupted");
    const SegmentKey& key = *next++;
    auto segment = context.store()->GetSegmentData(run.rig, key);
    if (absl::IsDataLoss(segment.status())) *damaged = key;
    return segment;
  };
}

absl::StatusOr<CalibrationResult> RunSolver(const RunContext& context,
                                            const StoredRun& run,
                                            const Rig& rig,
                                            const Calibration& start,
                                            const SegmentSource& segments,
                                            const CalibrateOptions& options) {
  const std::chrono::milliseconds limit = context.options.max_run_time;
  const auto deadline = std::chrono::steady_clock::now() + limit;
  const auto late = [&] { return std::chrono::steady_clock::now() > deadline; };
  const auto unwanted = [&] { return context.interrupted() || late(); };
  SELFCAL_ASSIGN_OR_RETURN(CalibrationResult result,
                           context.estimators.calibrate(
                               rig,
                               start,
                               segments,
                               options,
                               [&](const CalibrateProgress& progress) {
                                 context.current->AddStep(progress);
                                 PublishStep(context, run, progress);
                                 return !unwanted();
                               },
                               unwanted));
  if (result.status == CalibrateStatus::kCancelled && late() &&
      !context.interrupted()) {
    return absl::DeadlineExceededError(fmt::format(
        "it took longer than the {:g} s that a run may; smaller tables make it "
        "shorter",
        std::chrono::duration<double>(limit).count()));
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

// Where a run starts: at the version that it is based on, or, if the prior of
// the rig has a mean of its own, with that mean where nothing is known. After a
// device change, the options of the run have what is known.
Calibration StartOf(const StoredRun& run,
                    const Rig& rig,
                    const StoredCalibration& base) {
  if (!rig.prior_mean || run.change > 0) return base.theta;
  // The factory calibration is no estimate.
  if (!base.run) return PriorMean(rig);
  return StartFromPrior(rig, base.theta, base.covariance);
}

absl::StatusOr<StoredCalibration> ComputeCandidate(
    const RunContext& context,
    const StoredRun& run,
    std::optional<SegmentKey>* damaged) {
  const auto begin = std::chrono::steady_clock::now();
  Store* const store = context.store();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(run.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration base,
                           store->GetCalibration(run.rig, run.base_version));
  SELFCAL_ASSIGN_OR_RETURN(
      const CalibrateOptions options,
      OptionsOfRun(context.domain, context.options.calibrate, rig, run));
  SELFCAL_ASSIGN_OR_RETURN(CalibrationResult result,
                           RunSolver(context,
                                     run,
                                     rig.rig,
                                     StartOf(run, rig.rig, base),
                                     SegmentsOf(context, run, damaged),
                                     options));
  StoredCalibration candidate;
  candidate.state = CalibrationState::kCandidate;
  candidate.theta = result.theta;
  candidate.covariance = result.covariance;
  candidate.program_version = context.options.program_version;
  candidate.settings = RunSettings(options, run.change);
  candidate.report = std::move(result);
  candidate.steps = context.current->StepsOf(run.rig, run.run);
  candidate.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin)
          .count();
  return candidate;
}

}  // namespace

absl::StatusOr<StoredCalibration> EnsureCandidate(
    const RunContext& context,
    const StoredRun& run,
    std::optional<SegmentKey>* damaged) {
  auto stored = context.store()->GetCandidate(run.rig, run.run);
  if (!absl::IsNotFound(stored.status())) {
    return stored;
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration found,
                           ComputeCandidate(context, run, damaged));
  return RetryUnlessInterrupted(context.current, [&] {
    return context.domain->StoreCandidate(context.claim, run.run, found);
  });
}

}  // namespace selfcal::server
