// How a run comes to be: asked for, or called for by the tables.
#include <fmt/format.h>

#include <algorithm>

#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/clock.h"
#include "server/store/events.h"
#include "server/store/runs.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// The number of the newest run that fulfils a condition, 0 if there is none.
absl::StatusOr<std::int64_t> NewestRun(Connection* db,
                                       std::int64_t rig,
                                       const std::string& condition) {
  return ReadInt(
      db,
      "SELECT coalesce(max(run), 0) FROM runs WHERE rig = ?1 AND " + condition,
      rig);
}

absl::Status InsertSnapshot(Connection* db,
                            std::int64_t rig,
                            const StoredRun& run) {
  for (const SegmentKey& key : run.segments) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "INSERT INTO run_segments (rig, run, segment) "
                  "SELECT ?1, ?2, segment FROM segments "
                  "WHERE rig = ?1 AND session = ?3 AND session_index = ?4",
                  rig,
                  run.run,
                  key.session,
                  key.index)
            .Run());
  }
  return absl::OkStatus();
}

const char* TriggerText(RunTrigger trigger) {
  switch (trigger) {
    case RunTrigger::kTablesFull:
      return "the tables are full";
    case RunTrigger::kTablesChanged:
      return "the tables have changed";
    case RunTrigger::kChangeDetected:
      return "the tables are full again after a change";
    case RunTrigger::kCalibrationAged:
      return "the calibration is old";
    case RunTrigger::kSessionEnded:
      return "the session has ended, and the tables have changed";
    case RunTrigger::kManual:
      break;
  }
  return "asked for";
}

// In the column cause.
int CauseOf(RunTrigger trigger) {
  switch (trigger) {
    case RunTrigger::kTablesFull:
    case RunTrigger::kChangeDetected:
      return 1;
    case RunTrigger::kTablesChanged:
    case RunTrigger::kSessionEnded:
      return 2;
    case RunTrigger::kCalibrationAged:
      return 4;
    case RunTrigger::kManual:
      break;
  }
  return 3;
}

// Those that the result of a run is of, by key.
absl::StatusOr<std::vector<SegmentKey>> UsedSegments(Connection* db,
                                                     std::int64_t rig,
                                                     std::int64_t run) {
  Statement read(db,
                 "SELECT s.session, s.session_index FROM run_segments x "
                 "JOIN segments s USING (segment) "
                 "WHERE x.rig = ?1 AND x.run = ?2 AND x.excluded = 0 "
                 "ORDER BY s.session, s.session_index",
                 rig,
                 run);
  std::vector<SegmentKey> keys;
  while (read.Next()) {
    keys.push_back({read.Text(0), read.Int(1)});
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return keys;
}

// FAILED_PRECONDITION if a run on these tables would find what the newest
// version of a run already says: on the same segments, after the same change of
// the device, and from where that run or its result left the calibration.
absl::Status CheckThatTablesChanged(Connection* db,
                                    const RigRow& rig,
                                    const std::vector<Table>& tables) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest,
                           NewestRun(db, rig.rowid, "state = 3"));
  if (newest == 0) return absl::OkStatus();
  const std::string& id = rig.stored.rig.id;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun last, ReadRun(db, id, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentKey> used,
                           UsedSegments(db, rig.rowid, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change,
                           NewestChange(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active,
                           ActiveVersion(db, rig.rowid));
  std::vector<SegmentKey> held;
  for (const TableEntry& entry : UnionOfTables(tables)) {
    held.push_back(entry.key);
  }
  std::sort(held.begin(), held.end());
  const bool same_start =
      active == last.base_version || active == last.calibration_version;
  if (held != used || change != last.change || !same_start) {
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(fmt::format(
      "the tables of rig {} have not changed since version {} was computed; "
      "send segments with more motion, or force it to be computed anew",
      id,
      last.calibration_version));
}

}  // namespace

absl::StatusOr<std::optional<std::vector<SegmentKey>>> LastRunKeys(
    Connection* db, const RigRow& rig) {
  std::optional<std::vector<SegmentKey>> keys;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change,
                           NewestChange(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t triggered,
      NewestRun(db,
                rig.rowid,
                fmt::format("cause IN (1, 2) AND change = {}", change)));
  if (triggered == 0) {
    return keys;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest,
                           NewestRun(db, rig.rowid, "1"));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run,
                           ReadRun(db, rig.stored.rig.id, newest));
  keys = run.segments;
  return keys;
}

absl::StatusOr<StoredRun> InsertRun(Connection* db,
                                    const RigRow& rig,
                                    const std::vector<Table>& tables,
                                    RunTrigger trigger) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished,
                           NewestRun(db, rig.rowid, "state IN (1, 2)"));
  if (unfinished != 0) {
    return absl::FailedPreconditionError(fmt::format(
        "recalibration {} of rig {} is under way; wait for it or cancel it",
        unfinished,
        rig.stored.rig.id));
  }
  StoredRun run;
  for (const TableEntry& entry : UnionOfTables(tables)) {
    run.segments.push_back(entry.key);
  }
  if (run.segments.empty()) {
    return absl::FailedPreconditionError(fmt::format(
        "the tables of rig {} are empty; send segments with motion first",
        rig.stored.rig.id));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest,
                           NewestRun(db, rig.rowid, "1"));
  SELFCAL_ASSIGN_OR_RETURN(run.base_version, ActiveVersion(db, rig.rowid));
  SELFCAL_ASSIGN_OR_RETURN(run.change, NewestChange(db, rig.rowid));
  run.rig = rig.stored.rig.id;
  run.run = newest + 1;
  run.trigger = trigger == RunTrigger::kTablesFull && run.change > 0
                    ? RunTrigger::kChangeDetected
                    : trigger;
  run.create_time_ns = NowNs();
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO runs (rig, run, state, cause, create_time_ns, "
                "  base_version, change, session_ended) "
                "VALUES (?1, ?2, 1, ?3, ?4, ?5, ?6, ?7)",
                rig.rowid,
                run.run,
                CauseOf(trigger),
                run.create_time_ns,
                run.base_version,
                run.change,
                run.trigger == RunTrigger::kSessionEnded ? 1 : 0)
          .Run());
  SELFCAL_RETURN_IF_ERROR(InsertSnapshot(db, rig.rowid, run));
  SELFCAL_RETURN_IF_ERROR(AppendEvent(db,
                                      run.rig,
                                      EventKind::kRunStarted,
                                      fmt::format("run {} on {} segments: {}",
                                                  run.run,
                                                  run.segments.size(),
                                                  TriggerText(run.trigger))));
  return run;
}

absl::StatusOr<std::optional<StoredRun>> MaybeInsertRun(
    Connection* db, const RigRow& rig, const std::vector<Table>& tables) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished,
                           NewestRun(db, rig.rowid, "state IN (1, 2)"));
  std::optional<StoredRun> started;
  if (unfinished != 0) {
    return started;
  }
  SELFCAL_ASSIGN_OR_RETURN(const auto last_run, LastRunKeys(db, rig));
  const Trigger trigger = EvaluateTrigger(rig.stored.rig, tables, last_run);
  if (trigger == Trigger::kNone) {
    return started;
  }
  SELFCAL_ASSIGN_OR_RETURN(
      started,
      InsertRun(db,
                rig,
                tables,
                trigger == Trigger::kTablesFull ? RunTrigger::kTablesFull
                                                : RunTrigger::kTablesChanged));
  return started;
}

absl::StatusOr<StoredRun> CreateManualRunRow(Connection* db,
                                             const std::string& rig_name,
                                             bool force) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  SELFCAL_ASSIGN_OR_RETURN(const RigRow rig, ReadRig(db, rig_name));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           ReadFreshTables(db, rig, NowNs()));
  if (!force) {
    SELFCAL_RETURN_IF_ERROR(CheckThatTablesChanged(db, rig, tables));
  }
  SELFCAL_ASSIGN_OR_RETURN(StoredRun run,
                           InsertRun(db, rig, tables, RunTrigger::kManual));
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return run;
}

}  // namespace selfcal::server
