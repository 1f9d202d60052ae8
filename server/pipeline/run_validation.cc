#include "server/pipeline/run_validation.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <utility>

#include "core/change/concerned.h"
#include "server/domain/device_change.h"
#include "server/pipeline/after_change.h"
#include "server/pipeline/candidate_validation.h"
#include "server/pipeline/held_out.h"
#include "server/pipeline/rescoring.h"
#include "server/pipeline/stored_information.h"
#include "server/pipeline/verdict.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Number of held-out segments that a candidate is tested with.
constexpr int kHeldOut = 8;
// Scores with the noise that the rig states are used for tests while the noise
// that was used is at most this many times as large.
constexpr double kMaxNoiseOff = 1.5;

// The rig with the noise that the calibration was weighted with.
Rig WithUsedNoise(const Rig& rig, const CalibrationResult& result) {
  Rig used = rig;
  for (const NoiseScale& scale : result.noise_scales) {
    ScaleNoise(scale.kind, scale.used, &used);
  }
  return used;
}

bool StatedNoiseHolds(const CalibrationResult& result) {
  return std::all_of(
      result.noise_scales.begin(),
      result.noise_scales.end(),
      [](const NoiseScale& scale) { return scale.used <= kMaxNoiseOff; });
}

bool IsExcluded(const CalibrationResult& result, const SegmentKey& key) {
  return std::any_of(result.segment_fits.begin(),
                     result.segment_fits.end(),
                     [&](const SegmentFit& fit) {
                       return fit.key == key && !fit.excluded.empty();
                     });
}

// True for the factory calibration, and for a version whose run was created
// before the change was found, even if that run found it: its tables held
// segments from before.
absl::StatusOr<bool> IsFromBefore(Store* store,
                                  const StoredCalibration& active,
                                  std::int64_t change) {
  if (!active.run) return true;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                           store->GetRun(active.rig, *active.run));
  return run.change < change;
}

// nullopt if the data cannot be used; an error if it cannot be read now.
absl::StatusOr<std::optional<SegmentInformation>> Rescore(
    const RunContext& context,
    const std::string& rig_id,
    const SegmentKey& key,
    const Rig& rig,
    const Calibration& theta) {
  const auto segment = context.store()->GetSegmentData(rig_id, key);
  if (absl::IsDataLoss(segment.status()) ||
      absl::IsFailedPrecondition(segment.status())) {
    return std::nullopt;
  }
  SELFCAL_RETURN_IF_ERROR(segment.status());
  try {
    return context.estimators.score(rig, theta, *segment);
  } catch (const std::exception& error) {
    spdlog::warn("held-out segment {}~{} of rig {} cannot be scored: {}",
                 key.session,
                 key.index,
                 rig_id,
                 error.what());
    return std::nullopt;
  }
}

// Segments without data are held out only if the result does not rest on their
// ends.
absl::StatusOr<HeldOutSegments> GatherHeldOut(const RunContext& context,
                                              const StoredRun& run,
                                              const Rig& rig,
                                              const CalibrationResult& result) {
  HeldOutSegments segments;
  if (!HasUsableNumbers(rig, result)) return segments;
  SELFCAL_ASSIGN_OR_RETURN(
      std::vector<HeldOut> held_out,
      context.domain->ListHeldOut(run.rig, run.run, kHeldOut));
  const Rig used = WithUsedNoise(rig, result);
  const bool stated_noise_holds = StatedNoiseHolds(result);
  for (HeldOut& one : held_out) {
    std::optional<SegmentInformation> again;
    if (one.has_data) {
      SELFCAL_ASSIGN_OR_RETURN(
          again, Rescore(context, run.rig, one.key, used, result.theta));
    }
    if (again) {
      segments.push_back({*std::move(again), true});
    } else if (stated_noise_holds && result.remembered.segments == 0) {
      segments.push_back({std::move(one.information), false});
    }
  }
  return segments;
}

// The segments that the result uses; nullopt if the data of one is damaged or
// gone.
absl::StatusOr<std::optional<std::vector<MotionSegment>>> ReadUsed(
    const RunContext& context,
    const StoredRun& run,
    const CalibrationResult& result) {
  std::vector<MotionSegment> segments;
  for (const SegmentKey& key : run.segments) {
    if (IsExcluded(result, key)) continue;
    auto segment = context.store()->GetSegmentData(run.rig, key);
    if (absl::IsDataLoss(segment.status()) ||
        absl::IsFailedPrecondition(segment.status())) {
      return std::nullopt;
    }
    SELFCAL_RETURN_IF_ERROR(segment.status());
    segments.push_back(*std::move(segment));
  }
  return segments;
}

// What only their data shows: common mistakes, and effects that the rig does
// not estimate.
absl::Status ExamineUsed(const RunContext& context,
                         const StoredRun& run,
                         const Rig& rig,
                         const CalibrationResult& result,
                         CandidateEvidence* evidence) {
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredCalibration base,
      context.store()->GetCalibration(run.rig, run.base_version));
  SELFCAL_ASSIGN_OR_RETURN(const auto segments, ReadUsed(context, run, result));
  if (!segments) return absl::OkStatus();
  evidence->diagnosis = Diagnose(rig, base.theta, *segments);
  // Elsewhere than at the minimum, theta itself explains what is left.
  if (result.status == CalibrateStatus::kConverged &&
      HasUsableNumbers(rig, result)) {
    const bool completed = result.covariance_of_data.size() > 0;
    evidence->effects = TestAbsentEffects(
        WithUsedNoise(rig, result),
        {result.theta, result.covariance, result.track_noise_factor},
        completed ? result.covariance_of_data : result.covariance,
        *segments);
  }
  return absl::OkStatus();
}

// Sets state, reasons, validation and verdict of the candidate, validated
// against the active version. Returns what was found about that version; empty:
// nothing.
absl::StatusOr<std::string> Validate(const RunContext& context,
                                     const StoredRun& run,
                                     StoredCalibration* candidate) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           context.store()->GetRig(run.rig));
  const CalibrationResult& result = candidate->report.value();
  CandidateEvidence evidence;
  evidence.has_factory_prior = run.change == 0;
  SELFCAL_ASSIGN_OR_RETURN(evidence.active,
                           context.store()->GetActiveCalibration(run.rig));
  evidence.active.covariance =
      CovarianceAt(rig, evidence.active, context.options.now_ns());
  if (run.change > 0) {
    SELFCAL_ASSIGN_OR_RETURN(const StoredChange change,
                             context.store()->GetChange(run.rig, run.change));
    SELFCAL_ASSIGN_OR_RETURN(
        const bool from_before,
        IsFromBefore(context.store(), evidence.active, run.change));
    if (from_before) {
      SELFCAL_ASSIGN_OR_RETURN(
          const std::vector<SegmentInformation> since,
          ListInformation(context.store(), run.rig, run.segments));
      // A later one rests on segments of both devices.
      StoredCalibration before = evidence.active;
      if (before.version > change.base_version) {
        SELFCAL_ASSIGN_OR_RETURN(
            before,
            context.store()->GetCalibration(run.rig, change.base_version));
        before.covariance = CovarianceAt(rig, before, context.options.now_ns());
      }
      evidence.active.covariance =
          CovarianceAfter(rig.rig, change, before, since);
      // Without an estimate from before, nothing is known of the others.
      evidence.changed = before.run
                             ? ConcernedComponents(rig.rig, change.groups)
                             : FreeComponents(rig.rig);
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(evidence.held_out,
                           GatherHeldOut(context, run, rig.rig, result));
  SELFCAL_RETURN_IF_ERROR(
      ExamineUsed(context, run, rig.rig, result, &evidence));
  CandidateValidation validated = ValidateCandidate(rig.rig, result, evidence);
  candidate->verdict = MakeVerdict(rig.rig, result, validated);
  candidate->state = validated.reasons.empty() ? CalibrationState::kActive
                                               : CalibrationState::kRejected;
  candidate->reasons = std::move(validated.reasons);
  candidate->validation = std::move(validated.validation);
  return std::move(validated.of_active);
}

}  // namespace

absl::StatusOr<StoredCalibration> ValidateAndFinish(
    const RunContext& context,
    const StoredRun& run,
    StoredCalibration candidate) {
  std::optional<CandidateScores> scores;  // of the last validation with any
  for (;;) {
    SELFCAL_ASSIGN_OR_RETURN(const std::string finding,
                             Validate(context, run, &candidate));
    // The run ends after that, so that whoever sees the version sees the scores
    // at it. A crash between the two repeats it, or leaves a record by which
    // the scores are repaired.
    if (candidate.state == CalibrationState::kActive &&
        context.estimators.ends) {
      SELFCAL_ASSIGN_OR_RETURN(scores,
                               RescoreAtCandidate(context.domain,
                                                  context.estimators,
                                                  context.claim,
                                                  run.run,
                                                  candidate));
    }
    auto finished =
        context.domain->FinishRun(context.claim, run.run, candidate, finding);
    if (absl::IsAborted(finished.status())) continue;
    if (finished.ok() && scores) {
      EndRescoringOfRun(context.domain,
                        context.estimators,
                        context.claim,
                        *finished,
                        *scores);
    }
    return finished;
  }
}

}  // namespace selfcal::server
