#include "server/pipeline/verifier.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "server/domain/reports.h"
#include "server/pipeline/run_options.h"
#include "server/pipeline/stored_information.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status Interruption() {
  return absl::CancelledError("the verification was interrupted");
}

// True if there is no data to compute on: it was deleted, evicted, or is
// damaged.
bool IsGone(const absl::Status& status) {
  return absl::IsFailedPrecondition(status) || absl::IsNotFound(status) ||
         absl::IsDataLoss(status);
}

std::string SegmentName(const SegmentKey& key) {
  return fmt::format("segment {}~{}", key.session, key.index);
}

}  // namespace

Verifier::Interrupted Verifier::OrStopped(
    const Interrupted& interrupted) const {
  return [this, interrupted] {
    return stopped_ || (interrupted && interrupted());
  };
}

absl::StatusOr<Verification> Verifier::VerifyRig(
    const std::string& rig_name,
    const OnVerificationStep& on_step,
    const std::function<bool()>& interrupted) {
  if (!HasCeres()) {
    return absl::FailedPreconditionError(
        "the daemon was built without Ceres, the second core; use a build with "
        "SELFCAL_CERES=ON");
  }
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) {
    return absl::FailedPreconditionError(
        "another verification is under way; try again when it is done");
  }
  // What it finds is recorded with the rig.
  SELFCAL_RETURN_IF_ERROR(store_->Inspect(rig_name, CheckOwnRig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store_->GetActiveCalibration(rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<StoredSegment> segments,
                           ListKept(store_, rig_name));
  Verification verification;
  verification.version = active.version;
  VerificationStep step;
  step.total = static_cast<int>(segments.size()) + (active.run ? 1 : 0);
  for (const StoredSegment& segment : segments) {
    step.subject = SegmentName(segment.key);
    step.score = nullptr;
    on_step(step);
    SELFCAL_ASSIGN_OR_RETURN(ScoreCheck check,
                             CheckStored(rig, segment, interrupted));
    verification.scores.push_back(std::move(check));
    ++step.done;
    step.score = &verification.scores.back();
    on_step(step);
  }
  if (active.run) {
    step.subject = fmt::format("calibration {}", active.version);
    step.score = nullptr;
    on_step(step);
    SELFCAL_ASSIGN_OR_RETURN(
        verification.calibration,
        CheckCalibration(rig_name, active.version, interrupted));
    ++step.done;
    step.calibration = &*verification.calibration;
    on_step(step);
  }
  SELFCAL_RETURN_IF_ERROR(Conclude(rig_name, verification));
  return verification;
}

absl::StatusOr<ScoreCheck> Verifier::CheckStored(
    const StoredRig& rig,
    const StoredSegment& segment,
    const Interrupted& interrupted) {
  ScoreCheck check;
  check.segment = segment.key;
  const auto data = store_->GetSegmentData(rig.rig.id, segment.key);
  if (IsGone(data.status())) {
    check.message = std::string(data.status().message());
    return check;
  }
  SELFCAL_RETURN_IF_ERROR(data.status());
  const Interrupted stop = OrStopped(interrupted);
  const auto score = [&](ScorerKind scorer) {
    return estimators_.score_by(
        scorer, rig.rig, segment.information->theta0, *data, stop);
  };
  const auto structured = score(ScorerKind::kStructured);
  const auto ceres = structured.ok() ? score(ScorerKind::kCeres) : structured;
  if (stop()) return Interruption();
  if (!ceres.ok()) {
    check.message = std::string(ceres.status().message());
    return check;
  }
  check.difference = CompareScores(rig.rig, *structured, *ceres);
  check.outcome = IsRounding(check.difference) ? VerificationOutcome::kAgrees
                                               : VerificationOutcome::kDiffers;
  return check;
}

absl::StatusOr<ScoreCheck> Verifier::CheckScore(
    const Rig& rig,
    const MotionSegment& segment,
    const SegmentInformation& information,
    const std::function<bool()>& interrupted) {
  const ScorerKind other = options_.scorer == ScorerKind::kStructured
                               ? ScorerKind::kCeres
                               : ScorerKind::kStructured;
  ScoreCheck check;
  check.segment = segment.key;
  const Interrupted stop = OrStopped(interrupted);
  const auto score =
      estimators_.score_by(other, rig, information.theta0, segment, stop);
  if (stop()) return Interruption();
  if (!score.ok()) {
    check.message = std::string(score.status().message());
    return check;
  }
  check.difference = CompareScores(rig, information, *score);
  check.outcome = IsRounding(check.difference) ? VerificationOutcome::kAgrees
                                               : VerificationOutcome::kDiffers;
  return check;
}

absl::StatusOr<CalibrationCheck> Verifier::CheckCalibration(
    const std::string& rig_name,
    std::int64_t version,
    const std::function<bool()>& interrupted) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration calibration,
                           store_->GetCalibration(rig_name, version));
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredRun run,
      store_->GetRun(rig_name, calibration.run.value_or(0)));
  SELFCAL_ASSIGN_OR_RETURN(const CalibrateOptions options,
                           OptionsOfRun(domain_, options_.calibrate, rig, run));
  CalibrationCheck check;
  check.version = version;
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentKey> keys,
                           KeysWithData(calibration));
  check.segments = static_cast<int>(keys.size());
  check.segments_gone =
      static_cast<int>(calibration.segments.size() - keys.size());
  if (keys.empty()) {
    check.message = "the data of none of its segments is kept";
    return check;
  }
  const Interrupted stop = OrStopped(interrupted);
  const auto solve = [&](SolverKind solver) {
    return Solve(solver, rig.rig, calibration.theta, keys, options, stop);
  };
  const auto structured = solve(SolverKind::kStructured);
  const auto ceres = structured.ok() ? solve(SolverKind::kCeres) : structured;
  if (stop()) return Interruption();
  if (!ceres.ok()) {
    check.message = std::string(ceres.status().message());
    return check;
  }
  check.difference = CompareResults(rig.rig, *structured, *ceres);
  check.message = check.difference.incomparable;
  if (check.message.empty()) {
    check.outcome = IsConvergence(check.difference)
                        ? VerificationOutcome::kAgrees
                        : VerificationOutcome::kDiffers;
  }
  return check;
}

absl::StatusOr<std::vector<SegmentKey>> Verifier::KeysWithData(
    const StoredCalibration& version) {
  std::vector<SegmentKey> keys;
  for (const SegmentKey& key : version.segments) {
    const absl::Status read = store_->GetSegmentData(version.rig, key).status();
    if (read.ok()) {
      keys.push_back(key);
    } else if (!IsGone(read)) {
      return read;
    }
  }
  return keys;
}

absl::StatusOr<CalibrationResult> Verifier::Solve(
    SolverKind solver,
    const Rig& rig,
    const Calibration& start,
    const std::vector<SegmentKey>& keys,
    CalibrateOptions options,
    const Interrupted& interrupted) {
  options.solver = solver;
  const auto deadline =
      std::chrono::steady_clock::now() + options_.max_run_time;
  const auto unwanted = [&] {
    return interrupted() || std::chrono::steady_clock::now() > deadline;
  };
  const SegmentSource segments =
      [this, &rig, next = keys.begin(), end = keys.end()]() mutable
      -> absl::StatusOr<std::optional<MotionSegment>> {
    if (next == end) return std::nullopt;
    return store_->GetSegmentData(rig.id, *next++);
  };
  SELFCAL_ASSIGN_OR_RETURN(
      CalibrationResult result,
      estimators_.calibrate(
          rig,
          start,
          segments,
          options,
          [&](const CalibrateProgress&) { return !unwanted(); },
          unwanted));
  if (result.status == CalibrateStatus::kCancelled) {
    return absl::DeadlineExceededError(
        "a solver took longer than a run may (max-run-minutes)");
  }
  if (result.status == CalibrateStatus::kFailed) {
    return absl::InternalError("a solver failed: " + result.message);
  }
  return result;
}

absl::Status Verifier::Conclude(const std::string& rig,
                                const Verification& verification) {
  if (options_.observer != nullptr) {
    for (const ScoreCheck& check : verification.scores) {
      options_.observer->OnCheck(PipelineObserver::CheckSubject::kScore,
                                 check.outcome);
    }
    if (verification.calibration) {
      options_.observer->OnCheck(PipelineObserver::CheckSubject::kCalibration,
                                 verification.calibration->outcome);
    }
  }
  const std::string finding = DisagreementText(verification);
  if (finding.empty()) return absl::OkStatus();
  spdlog::error("rig {}, version {}: {}", rig, verification.version, finding);
  SELFCAL_RETURN_IF_ERROR(
      domain_->ReportDisagreement(rig, verification.version, finding));
  on_finding_(rig);
  return absl::OkStatus();
}

}  // namespace selfcal::server
