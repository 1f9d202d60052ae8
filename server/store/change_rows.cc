#include "server/store/change_rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/change/isolated.h"
#include "server/store/absences.h"
#include "server/store/calibrations.h"
#include "server/store/checksum.h"
#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/fit_rows.h"
#include "server/store/quarantine.h"
#include "server/store/records.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// A run is as likely to find a change where there is none as the tests of so
// many single segments: about as many come between two runs.
constexpr double kSegmentsOfARun = 10;

absl::StatusOr<SegmentInformation> ReadInformation(const Statement& row) {
  constexpr char kWhat[] = "the information of a segment";
  const std::string bytes = row.Text(1);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(bytes, row.Text(2), kWhat));
  return ParseInformation(bytes, kWhat);
}

struct SegmentId {
  std::int64_t rowid = 0;
  SegmentKey key;
};

// The newest segments that can be tested, oldest first: `count` of twice as
// many, but for those that are isolated (core/change/isolated.h).
struct Newest {
  std::vector<OffsetInformation> segments;
  std::vector<std::int64_t> sequences;
  // Those between two neighbours that both contradict them.
  std::vector<SegmentId> isolated;
};

absl::StatusOr<Newest> ReadNewest(Connection* db,
                                  const RigRow& rig,
                                  const StoredCalibration& active,
                                  std::int64_t first_sequence,
                                  const ConsistencyTester& tester,
                                  int count) {
  Statement read(
      db,
      fmt::format("SELECT s.sequence, i.information, i.sha256, s.segment, "
                  "  s.session, s.session_index FROM segments "
                  "s JOIN segment_information i USING (segment) "
                  "WHERE s.rig = ?1 AND s.state = 2 AND s.sequence >= ?2 "
                  "  AND {} "
                  "  AND NOT EXISTS (SELECT 1 FROM calibration_segments c "
                  "    WHERE c.rig = ?1 AND c.version = ?3 "
                  "      AND c.segment = s.segment) "
                  "ORDER BY s.sequence DESC LIMIT ?4",
                  kFits),
      rig.rowid,
      first_sequence,
      active.version,
      2 * count);
  Newest newest;
  std::vector<SegmentId> ids;
  while (static_cast<int>(newest.segments.size()) < count && read.Next()) {
    const auto information = ReadInformation(read);
    if (!information.ok() || !tester.Accepts(*information)) {
      continue;
    }
    newest.sequences.push_back(read.Int(0));
    ids.push_back({read.Int(3), {read.Text(4), read.Int(5)}});
    newest.segments.push_back(tester.Offset(*information));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  std::reverse(newest.segments.begin(), newest.segments.end());
  std::reverse(newest.sequences.begin(), newest.sequences.end());
  std::reverse(ids.begin(), ids.end());
  std::vector<int> isolated = FindIsolated(newest.segments);
  std::reverse(isolated.begin(), isolated.end());
  const auto last = static_cast<int>(newest.segments.size()) - 1;
  for (const int i : isolated) {
    if (i > 0 && i < last) newest.isolated.push_back(ids[i]);
    newest.segments.erase(newest.segments.begin() + i);
    newest.sequences.erase(newest.sequences.begin() + i);
  }
  return newest;
}

// Whether the segments can be tested against it: the factory's calibration is
// a prior, not an estimate, one from before the last change is no longer that
// of the device, and one from before the noise of tracks was measured claims
// sigmas that are too small.
absl::StatusOr<bool> StandsSince(Connection* db,
                                 const StoredCalibration& active,
                                 std::int64_t change) {
  if (!active.run || !active.report || active.report->track_noise_factor == 0) {
    return false;
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                           ReadRun(db, active.rig, *active.run));
  return run.change == change;
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

absl::Status RestartTables(Connection* db,
                           std::int64_t rig,
                           std::int64_t first_sequence) {
  SELFCAL_RETURN_IF_ERROR(
      LeaveTables(db,
                  AbsenceCause::kDeviceChanged,
                  "rig = ?3 AND segment IN (SELECT segment FROM segments "
                  "  WHERE rig = ?3 AND sequence < ?4)",
                  rig,
                  first_sequence));
  return Statement(db,
                   "UPDATE tables SET scored = "
                   "  (SELECT count(*) FROM segments WHERE rig = ?1 "
                   "    AND state = 2 AND sequence >= ?2) "
                   "WHERE rig = ?1",
                   rig,
                   first_sequence)
      .Run();
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

absl::Status InsertChange(Connection* db,
                          std::int64_t rig,
                          const StoredChange& change) {
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO changes (rig, change, time_ns, kind, "
                "  first_sequence, base_version, inflation) "
                "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                rig,
                change.change,
                change.time_ns,
                static_cast<int>(change.kind) + 1,
                change.first_sequence,
                change.base_version,
                change.inflation)
          .Run());
  for (const std::string& group : change.groups) {
    SELFCAL_RETURN_IF_ERROR(Statement(db,
                                      "INSERT INTO change_groups "
                                      "(rig, change, group_name) "
                                      "VALUES (?1, ?2, ?3)",
                                      rig,
                                      change.change,
                                      group)
                                .Run());
  }
  return absl::OkStatus();
}

// Writes the change and its event, and has all start anew with the segments
// after it.
absl::Status StartAfter(Connection* db,
                        std::int64_t rig,
                        const StoredChange& change,
                        const std::string& description) {
  SELFCAL_RETURN_IF_ERROR(InsertChange(db, rig, change));
  SELFCAL_RETURN_IF_ERROR(RestartTables(db, rig, change.first_sequence));
  SELFCAL_RETURN_IF_ERROR(ForgetBefore(db, rig, change.first_sequence));
  return AppendEvent(db, change.rig, EventKind::kChangeDetected, description);
}

}  // namespace

absl::StatusOr<std::int64_t> NewestChange(Connection* db, std::int64_t rig) {
  return ReadInt(
      db, "SELECT coalesce(max(change), 0) FROM changes WHERE rig = ?1", rig);
}

absl::StatusOr<StoredChange> ReadChange(Connection* db,
                                        const std::string& rig,
                                        std::int64_t number) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 "SELECT time_ns, kind, first_sequence, base_version, "
                 "  inflation FROM changes WHERE rig = ?1 AND change = ?2",
                 rig_id,
                 number);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::NotFoundError(
        fmt::format("rig {} has no change {}", rig, number));
  }
  StoredChange change;
  change.rig = rig;
  change.change = number;
  change.time_ns = read.Int(0);
  change.kind = static_cast<ChangeKind>(read.Int(1) - 1);
  change.first_sequence = read.Int(2);
  change.base_version = read.Int(3);
  change.inflation = read.Double(4);
  Statement groups(db,
                   "SELECT c.group_name FROM change_groups c "
                   "JOIN tables t ON t.rig = c.rig "
                   "  AND t.group_name = c.group_name "
                   "WHERE c.rig = ?1 AND c.change = ?2 ORDER BY t.position",
                   rig_id,
                   number);
  while (groups.Next()) {
    change.groups.push_back(groups.Text(0));
  }
  SELFCAL_RETURN_IF_ERROR(groups.status());
  return change;
}

absl::StatusOr<std::int64_t> FirstSequenceSince(Connection* db,
                                                const std::string& rig,
                                                std::int64_t change) {
  if (change == 0) return 1;
  SELFCAL_ASSIGN_OR_RETURN(const StoredChange stored,
                           ReadChange(db, rig, change));
  return stored.first_sequence;
}

absl::StatusOr<NewestJudged> JudgeNewest(Connection* db,
                                         const RigRow& rig,
                                         const ChangeOptions& options) {
  NewestJudged judged;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest_change,
                           NewestChange(db, rig.rowid));
  const auto active = ReadActiveCalibration(db, rig.stored.rig.id);
  if (absl::IsDataLoss(active.status())) {
    return judged;
  }
  SELFCAL_RETURN_IF_ERROR(active.status());
  SELFCAL_ASSIGN_OR_RETURN(const bool stands,
                           StandsSince(db, *active, newest_change));
  if (!stands) {
    return judged;
  }
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t first_sequence,
      FirstSequenceSince(db, rig.stored.rig.id, newest_change));
  const std::int64_t now_ns = NowNs();
  const ConsistencyTester tester(rig.stored.rig,
                                 {active->theta,
                                  CovarianceAt(rig.stored, *active, now_ns),
                                  active->report->track_noise_factor},
                                 options.inflation);
  SELFCAL_ASSIGN_OR_RETURN(
      const Newest newest,
      ReadNewest(db, rig, *active, first_sequence, tester, options.max_window));
  for (const SegmentId& id : newest.isolated) {
    SELFCAL_RETURN_IF_ERROR(SetAside(
        db,
        rig.stored.rig.id,
        id.key,
        id.rowid,
        EventKind::kSegmentQuarantined,
        fmt::format("it shows another theta than the segments before and after "
                    "it, at the scores of version {}: it is corrupt, or of "
                    "another device",
                    active->version)));
  }
  judged.quarantined = static_cast<int>(newest.isolated.size());
  const auto found = DetectChange(tester, newest.segments, options);
  if (!found) {
    return judged;
  }
  StoredChange change;
  change.rig = rig.stored.rig.id;
  change.change = newest_change + 1;
  change.time_ns = now_ns;
  change.kind = found->kind;
  change.first_sequence =
      found->segments_since == 0
          ? newest.sequences.back() + 1
          : newest.sequences[newest.sequences.size() - found->segments_since];
  change.base_version = active->version;
  change.inflation = tester.inflation();
  change.groups = found->concerned;
  SELFCAL_RETURN_IF_ERROR(
      StartAfter(db, rig.rowid, change, Describe(*found, change)));
  judged.change = std::move(change);
  return judged;
}

absl::StatusOr<std::optional<StoredChange>> MaybeInsertSplit(
    Connection* db,
    const RigRow& rig,
    const StoredRun& run,
    const StoredCalibration& result,
    const ChangeOptions& options) {
  const std::optional<StoredChange> none;
  if (!result.report || !result.report->evicted.split) return none;
  const DeviceSplit& split = *result.report->evicted.split;
  if (!(split.without_one < kSegmentsOfARun * options.false_alarm_rate)) {
    return none;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest_change,
                           NewestChange(db, rig.rowid));
  if (run.change != newest_change) return none;
  const auto first = FindSegment(db, rig.rowid, split.first);
  if (absl::IsNotFound(first.status())) return none;  // deleted meanwhile
  SELFCAL_RETURN_IF_ERROR(first.status());
  StoredChange change;
  change.rig = rig.stored.rig.id;
  change.change = newest_change + 1;
  change.time_ns = NowNs();
  change.kind = split.kind;
  change.first_sequence = first->sequence;
  change.base_version = run.base_version;
  change.inflation = 1;
  change.groups = split.concerned;
  SELFCAL_RETURN_IF_ERROR(
      StartAfter(db, rig.rowid, change, Describe(split, change, run.run)));
  return change;
}

absl::StatusOr<std::vector<Store::HeldOut>> ListHeldOutRows(
    Connection* db,
    const std::string& rig,
    std::int64_t run_number,
    int limit) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(db, rig, run_number));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t first_sequence,
                           FirstSequenceSince(db, rig, run.change));
  Statement read(
      db,
      fmt::format("SELECT s.sequence, i.information, i.sha256, "
                  "  s.session, s.session_index, "
                  "  EXISTS (SELECT 1 FROM payloads p "
                  "    WHERE p.segment = s.segment) AS has_data "
                  "FROM segments s JOIN segment_information i USING "
                  "(segment) "
                  "WHERE s.rig = ?1 AND s.state = 2 AND s.sequence >= ?2 "
                  "  AND {} "
                  "  AND NOT EXISTS (SELECT 1 FROM run_segments x "
                  "    WHERE x.rig = ?1 AND x.run = ?3 "
                  "      AND x.segment = s.segment) "
                  "ORDER BY has_data DESC, s.sequence DESC LIMIT ?4",
                  kFits),
      rig_id,
      first_sequence,
      run_number,
      limit);
  std::vector<Store::HeldOut> held_out;
  while (read.Next()) {
    auto information = ReadInformation(read);
    if (information.ok()) {
      held_out.push_back({{read.Text(3), read.Int(4)},
                          read.Int(5) != 0,
                          *std::move(information)});
    }
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return held_out;
}

}  // namespace selfcal::server
