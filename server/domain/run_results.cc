#include "server/domain/run_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "server/domain/calibration_life.h"
#include "server/domain/device_change.h"
#include "server/domain/quarantine.h"
#include "server/domain/retention.h"
#include "server/domain/run_creation.h"
#include "server/domain/run_life.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

// Returns the candidate of the run, and stores it if there is none yet.
absl::StatusOr<StoredCalibration> EnsureCandidate(
    UnitOfWork* tx,
    const StoredRun& run,
    const StoredCalibration& calibration) {
  SELFCAL_ASSIGN_OR_RETURN(const auto version, CandidateOfRun(tx, run.run));
  if (version) {
    return ReadCalibration(tx, *version);
  }
  StoredCalibration stored = calibration;
  SELFCAL_ASSIGN_OR_RETURN(stored.version, NextVersion(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t schema, SchemaVersion(tx));
  stored.schema_version = static_cast<int>(schema);
  stored.rig = run.rig;
  stored.state = CalibrationState::kCandidate;
  stored.create_time_ns = tx->time_ns();
  stored.create_steady_ns = tx->now().steady_ns;
  stored.run = run.run;
  stored.base_version = run.base_version;
  stored.segments = run.segments;
  stored.reasons.clear();
  stored.validation.reset();
  SELFCAL_RETURN_IF_ERROR(InsertCalibration(tx, stored));
  return stored;
}

// ABORTED if it was validated against another version than the active one.
absl::Status CheckValidation(UnitOfWork* tx,
                             const StoredCalibration& calibration) {
  if (!calibration.validation) {
    return absl::OkStatus();
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  if (calibration.validation->active_version != active) {
    return absl::AbortedError(
        fmt::format("it was validated against version {}, but {} is active now",
                    calibration.validation->active_version,
                    active));
  }
  return absl::OkStatus();
}

// False if a check failed for which a device change is no reason: segments that
// do not fit, or a solver that did not converge, show no change that could be
// believed.
bool ChangeExplains(const StoredCalibration& validated) {
  static constexpr std::string_view kExplained[] = {"segments_used",
                                                    "prior_sigmas",
                                                    "prior_agreement",
                                                    "rank",
                                                    "sigma_growth",
                                                    "halves",
                                                    "disagreement",
                                                    "remembered",
                                                    "held_out_probability",
                                                    "confirmed"};
  if (!validated.validation) return true;
  const auto& checks = validated.validation->checks;
  return std::all_of(checks.begin(), checks.end(), [](const auto& check) {
    return check.outcome != CheckOutcome::kFailed ||
           std::find(std::begin(kExplained),
                     std::end(kExplained),
                     check.name) != std::end(kExplained);
  });
}

// A finding about the version that stays active.
absl::Status RecordFinding(UnitOfWork* tx,
                           const std::string& finding,
                           StoredCalibration* rejected) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  rejected->reasons.push_back(
      fmt::format("Version {}, which stays active: {}", active, finding));
  return InsertFinding(tx, active, finding);
}

// Rejects a result that is outdated by what happened since the run was created.
absl::Status RejectIfOutdated(UnitOfWork* tx,
                              const StoredRun& run,
                              bool has_split,
                              StoredCalibration* validated) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change, NewestChange(tx));
  // The result accounts for a device change among its own segments: its theta
  // is that of the newest ones.
  if (!has_split && run.change != change) {
    validated->state = CalibrationState::kRejected;
    validated->reasons.push_back(
        fmt::format("The device has changed (change {}) since its segments "
                    "were chosen: the next run is on segments after that.",
                    change));
  }
  SELFCAL_ASSIGN_OR_RETURN(const auto unusable,
                           UnusableSegments(tx, run.run, false));
  if (!unusable.empty()) {
    validated->state = CalibrationState::kRejected;
    validated->reasons.push_back(
        fmt::format("{} became unusable since its segments were chosen",
                    SegmentText(tx->rig(), unusable.front())));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<StoredCalibration> StoreCandidate(
    UnitOfWork* tx,
    std::int64_t run_number,
    const StoredCalibration& calibration) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRunningRun(tx, run_number));
  return EnsureCandidate(tx, run, calibration);
}

absl::StatusOr<StoredCalibration> FinishRun(
    UnitOfWork* tx,
    std::int64_t run_number,
    const StoredCalibration& calibration,
    const std::string& finding,
    const ChangeOptions& options) {
  if (calibration.state != CalibrationState::kActive &&
      calibration.state != CalibrationState::kRejected) {
    return absl::InvalidArgumentError(
        "a run ends with a calibration that is active or rejected");
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run, ReadRunningRun(tx, run_number));
  SELFCAL_RETURN_IF_ERROR(CheckValidation(tx, calibration));
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration validated,
                           EnsureCandidate(tx, run, calibration));
  validated.state = calibration.state;
  validated.reasons = calibration.reasons;
  validated.validation = calibration.validation;
  validated.verdict = calibration.verdict;
  if (!finding.empty()) {
    SELFCAL_RETURN_IF_ERROR(RecordFinding(tx, finding, &validated));
  }
  std::optional<StoredChange> split;
  if (ChangeExplains(validated)) {
    SELFCAL_ASSIGN_OR_RETURN(split, StoreSplit(tx, run, validated, options));
  }
  SELFCAL_RETURN_IF_ERROR(
      RejectIfOutdated(tx, run, split.has_value(), &validated));
  SELFCAL_RETURN_IF_ERROR(EndValidation(tx, validated));
  // Segments of a device that changed contradict each other, and none is wrong.
  if (validated.state == CalibrationState::kActive && calibration.report &&
      !split) {
    SELFCAL_RETURN_IF_ERROR(
        QuarantineExcluded(tx, run.run, calibration.report->segment_fits));
  }
  run.state = RunState::kSucceeded;
  run.end_time_ns = tx->time_ns();
  run.end_steady_ns = tx->now().steady_ns;
  run.calibration_version = validated.version;
  SELFCAL_RETURN_IF_ERROR(WriteEnd(tx, run));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           RemoveAgedEntries(tx, rig, tx->now().steady_ns));
  SELFCAL_RETURN_IF_ERROR(CreateRunOfTables(tx, rig, tables).status());
  SELFCAL_RETURN_IF_ERROR(DropUnneededData(tx));
  return ReadCalibration(tx, validated.version);
}

}  // namespace selfcal::server
