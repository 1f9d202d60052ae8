#include "server/domain/device_change.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/change/aged.h"
#include "core/change/isolated.h"
#include "server/domain/exclusion.h"
#include "server/domain/quarantine.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/events.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// A run may raise as many false alarms as the tests of this many single
// segments: about as many arrive between two runs.
constexpr double kSegmentsOfARun = 10;

// The newest segments that can be tested, oldest first: at most `count` of
// twice as many, without the isolated ones (core/change/isolated.h).
struct Newest {
  std::vector<OffsetInformation> segments;
  std::vector<std::int64_t> sequences;
  // Segments between two neighbours that both contradict them.
  std::vector<SegmentRow> isolated;
};

absl::StatusOr<Newest> ReadNewest(UnitOfWork* tx,
                                  const StoredCalibration& active,
                                  std::int64_t first_sequence,
                                  const ConsistencyTester& tester,
                                  int count) {
  Newest newest;
  std::vector<SegmentRow> rows;
  SELFCAL_RETURN_IF_ERROR(VisitScored(
      tx,
      {.first_sequence = first_sequence,
       .not_in_version = active.version,
       .limit = 2 * count,
       .not_excluded_for = kMisfit},
      [&](const ScoredSegment& scored) {
        if (scored.information.ok() && tester.Accepts(*scored.information)) {
          rows.push_back(scored.segment);
          newest.segments.push_back(tester.Offset(*scored.information));
        }
        return static_cast<int>(rows.size()) < count;
      }));
  std::reverse(newest.segments.begin(), newest.segments.end());
  std::reverse(rows.begin(), rows.end());
  std::vector<int> isolated = FindIsolated(newest.segments);
  std::reverse(isolated.begin(), isolated.end());
  const auto last = static_cast<int>(newest.segments.size()) - 1;
  for (const int i : isolated) {
    if (i > 0 && i < last) newest.isolated.push_back(rows[i]);
    newest.segments.erase(newest.segments.begin() + i);
    rows.erase(rows.begin() + i);
  }
  for (const SegmentRow& row : rows) newest.sequences.push_back(row.sequence);
  return newest;
}

// True if segments can be tested against the calibration. The factory
// calibration is a prior, not an estimate; one from before the last device
// change is no longer that of the device; and one from before the track noise
// was measured states sigmas that are too small.
absl::StatusOr<bool> IsTestable(UnitOfWork* tx,
                                const StoredCalibration& active,
                                std::int64_t change) {
  if (!active.run || !active.report || active.report->track_noise_factor == 0) {
    return false;
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(tx, *active.run));
  return run.change == change;
}

// nullopt: it is gone.
absl::StatusOr<std::optional<std::int64_t>> SequenceOf(UnitOfWork* tx,
                                                       const SegmentKey& key) {
  const auto segment = FindSegment(tx, key);
  if (absl::IsNotFound(segment.status())) return std::nullopt;
  SELFCAL_RETURN_IF_ERROR(segment.status());
  return segment->sequence;
}

// The newest segment without data that the calibration rests on; 0: none;
// nullopt: it is not known.
absl::StatusOr<std::optional<std::int64_t>> NewestRemembered(
    UnitOfWork* tx, const StoredCalibration& calibration) {
  if (!calibration.report || calibration.report->remembered.segments == 0) {
    return 0;
  }
  return SequenceOf(tx, calibration.report->remembered.newest);
}

// Returns whether the calibration rests on a segment from `first_sequence` on,
// or may do so.
absl::StatusOr<bool> RestsOnAnySince(UnitOfWork* tx,
                                     const StoredCalibration& calibration,
                                     std::int64_t first_sequence) {
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<std::int64_t> newest,
                           NewestRemembered(tx, calibration));
  if (!newest || *newest >= first_sequence) return true;
  for (const SegmentKey& key : calibration.segments) {
    SELFCAL_ASSIGN_OR_RETURN(const std::optional<std::int64_t> sequence,
                             SequenceOf(tx, key));
    if (sequence && *sequence >= first_sequence) return true;
  }
  return false;
}

// The newest version up to `version` that rests on none of the segments from
// `first_sequence` on: what it knows is not known from them. The factory
// calibration if there is none since the last device change; from before that,
// its groups are out of date.
absl::StatusOr<std::int64_t> VersionBefore(UnitOfWork* tx,
                                           std::int64_t version,
                                           std::int64_t change,
                                           std::int64_t first_sequence) {
  constexpr std::int64_t kFactory = 1;
  while (version > kFactory) {
    const auto calibration = ReadCalibration(tx, version);
    if (absl::IsDataLoss(calibration.status())) return kFactory;
    SELFCAL_RETURN_IF_ERROR(calibration.status());
    if (!calibration->run) return kFactory;
    SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                             ReadRun(tx, *calibration->run));
    if (run.change != change) return kFactory;
    SELFCAL_ASSIGN_OR_RETURN(const bool rests,
                             RestsOnAnySince(tx, *calibration, first_sequence));
    if (!rests) return version;
    version = run.base_version;
  }
  return kFactory;
}

std::string Describe(const Change& found, const StoredChange& change) {
  return fmt::format(
      "change {} ({}): calibration {} does not fit the segments from sequence "
      "{} on; concerned: {}; chi-square {:.1f} with {} degrees over {} "
      "segments, {} changed "
      "(probability {:.1e}; variances of segments times {:.2f})",
      change.change,
      found.kind == ChangeKind::kSudden ? "sudden" : "drift",
      change.base_version,
      change.first_sequence,
      fmt::join(change.groups, ", "),
      found.test.statistic,
      found.test.degrees,
      found.window,
      found.block == "all" ? "anything" : found.block,
      found.test.probability,
      change.inflation);
}

std::string Describe(const DeviceSplit& split,
                     const StoredChange& change,
                     std::int64_t run) {
  return fmt::format(
      "change {}: among the segments of recalibration {} the newest {}, from "
      "sequence {} on, show another {} than those before; concerned: {} "
      "(probability {:.1e}, {:.1e} whichever of them is left out)",
      change.change,
      run,
      split.newer,
      change.first_sequence,
      split.block == "all" ? "theta" : split.block,
      fmt::join(change.groups, ", "),
      split.probability,
      split.without_one);
}

absl::Status RestartTables(UnitOfWork* tx, std::int64_t first_sequence) {
  SELFCAL_RETURN_IF_ERROR(LeaveTablesIf(
      tx, ExclusionCause::kDeviceChanged, [&](const TableEntry& entry) {
        return entry.sequence < first_sequence;
      }));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t scored,
                           CountScored(tx, first_sequence));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables, ReadTables(tx));
  for (const Table& table : tables) {
    SELFCAL_RETURN_IF_ERROR(WriteScored(tx, table.group, scored));
  }
  return absl::OkStatus();
}

// Stores the change and its event, and starts tables and memory again after it.
absl::Status StartAfter(UnitOfWork* tx,
                        const StoredChange& change,
                        const std::string& description) {
  SELFCAL_RETURN_IF_ERROR(InsertChange(tx, change));
  SELFCAL_RETURN_IF_ERROR(RestartTables(tx, change.first_sequence));
  SELFCAL_RETURN_IF_ERROR(DeleteEndsBefore(tx, change.first_sequence));
  return AppendEvent(tx, EventKind::kChangeDetected, description);
}

}  // namespace

Eigen::MatrixXd CovarianceAt(const StoredRig& rig,
                             const StoredCalibration& calibration,
                             std::int64_t time_ns) {
  const auto age_ns =
      static_cast<double>(time_ns - calibration.create_steady_ns);
  return AgedCovariance(rig.rig,
                        WalkDensities(rig.rig, rig.policy.walk_densities),
                        calibration.covariance,
                        age_ns / kNanosecondsOfDay);
}

absl::StatusOr<std::int64_t> FirstSequenceSince(UnitOfWork* tx,
                                                std::int64_t change) {
  if (change == 0) return 1;
  SELFCAL_ASSIGN_OR_RETURN(const StoredChange stored, ReadChange(tx, change));
  return stored.first_sequence;
}

absl::StatusOr<NewestExamined> ExamineNewest(UnitOfWork* tx,
                                             const StoredRig& rig,
                                             const ChangeOptions& options) {
  NewestExamined examined;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest_change, NewestChange(tx));
  const auto active = ReadActiveCalibration(tx);
  if (absl::IsDataLoss(active.status())) {
    return examined;
  }
  SELFCAL_RETURN_IF_ERROR(active.status());
  SELFCAL_ASSIGN_OR_RETURN(const bool testable,
                           IsTestable(tx, *active, newest_change));
  if (!testable) {
    return examined;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t since_change,
                           FirstSequenceSince(tx, newest_change));
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<std::int64_t> remembered,
                           NewestRemembered(tx, *active));
  const std::int64_t first_sequence =
      std::max(since_change, remembered.value_or(0) + 1);
  const ConsistencyTester tester(
      rig.rig,
      {active->theta,
       CovarianceAt(rig, *active, tx->now().steady_ns),
       active->report->track_noise_factor},
      options.inflation);
  SELFCAL_ASSIGN_OR_RETURN(
      const Newest newest,
      ReadNewest(tx, *active, first_sequence, tester, options.max_window));
  for (const SegmentRow& segment : newest.isolated) {
    SELFCAL_RETURN_IF_ERROR(Quarantine(
        tx,
        segment,
        EventKind::kSegmentQuarantined,
        fmt::format("it shows another theta than the segments before and after "
                    "it, at the scores of version {}: it is corrupt, or of "
                    "another device",
                    active->version)));
  }
  examined.quarantined = static_cast<int>(newest.isolated.size());
  const auto found = DetectChange(tester, newest.segments, options);
  if (!found) {
    return examined;
  }
  StoredChange change;
  change.rig = tx->rig();
  change.change = newest_change + 1;
  change.time_ns = tx->time_ns();
  change.kind = found->kind;
  change.first_sequence =
      found->segments_since == 0
          ? newest.sequences.back() + 1
          : newest.sequences[newest.sequences.size() - found->segments_since];
  change.base_version = active->version;
  change.inflation = tester.inflation();
  change.groups = found->concerned;
  SELFCAL_RETURN_IF_ERROR(StartAfter(tx, change, Describe(*found, change)));
  examined.change = std::move(change);
  return examined;
}

absl::StatusOr<std::optional<StoredChange>> StoreSplit(
    UnitOfWork* tx,
    const StoredRun& run,
    const StoredCalibration& result,
    const ChangeOptions& options) {
  const std::optional<StoredChange> none;
  if (!result.report || !result.report->remembered.split) return none;
  const DeviceSplit& split = *result.report->remembered.split;
  if (!(split.without_one < kSegmentsOfARun * options.false_alarm_rate)) {
    return none;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest_change, NewestChange(tx));
  if (run.change != newest_change) return none;
  const auto first = FindSegment(tx, split.first);
  if (absl::IsNotFound(first.status())) return none;  // deleted meanwhile
  SELFCAL_RETURN_IF_ERROR(first.status());
  StoredChange change;
  change.rig = tx->rig();
  change.change = newest_change + 1;
  change.time_ns = tx->time_ns();
  change.kind = split.kind;
  change.first_sequence = first->sequence;
  SELFCAL_ASSIGN_OR_RETURN(
      change.base_version,
      VersionBefore(tx, run.base_version, run.change, first->sequence));
  change.inflation = 1;
  change.groups = split.concerned;
  SELFCAL_RETURN_IF_ERROR(
      StartAfter(tx, change, Describe(split, change, run.run)));
  return change;
}

}  // namespace selfcal::server
