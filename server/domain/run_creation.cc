#include "server/domain/run_creation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "server/domain/retention.h"
#include "server/status/status_macros.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"

namespace selfcal::server {
namespace {

// FAILED_PRECONDITION if a run on these tables would repeat the newest
// successful run: the same segments, no device change since, and the active
// version is the one that run started from or its result.
absl::Status CheckThatTablesChanged(UnitOfWork* tx,
                                    const std::vector<Table>& tables) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestSucceededRun(tx));
  if (newest == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun last, ReadRun(tx, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentKey> used,
                           UsedSegments(tx, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change, NewestChange(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
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
      "send segments with more motion, or force the computation",
      tx->rig(),
      last.calibration_version));
}

}  // namespace

bool HoldAnother(const std::vector<Table>& tables, const StoredRun& run) {
  const auto entries = UnionOfTables(tables);
  return std::any_of(entries.begin(), entries.end(), [&](const auto& entry) {
    return std::find(run.segments.begin(), run.segments.end(), entry.key) ==
           run.segments.end();
  });
}

absl::StatusOr<std::optional<std::vector<SegmentKey>>> LastRunKeys(
    UnitOfWork* tx) {
  std::optional<std::vector<SegmentKey>> keys;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change, NewestChange(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t of_tables,
                           NewestRunOf(tx,
                                       {RunTrigger::kTablesFull,
                                        RunTrigger::kChangeDetected,
                                        RunTrigger::kTablesChanged,
                                        RunTrigger::kSessionEnded},
                                       change));
  if (of_tables == 0) {
    return keys;
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(tx, newest));
  keys = run.segments;
  return keys;
}

absl::StatusOr<StoredRun> CreateRun(UnitOfWork* tx,
                                    const std::vector<Table>& tables,
                                    const RunReason& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished, UnfinishedRun(tx));
  if (unfinished != 0) {
    return absl::FailedPreconditionError(fmt::format(
        "recalibration {} of rig {} is under way; wait for it or cancel it",
        unfinished,
        tx->rig()));
  }
  StoredRun run;
  for (const TableEntry& entry : UnionOfTables(tables)) {
    run.segments.push_back(entry.key);
  }
  if (run.segments.empty()) {
    return absl::FailedPreconditionError(fmt::format(
        "the tables of rig {} are empty; send segments with motion first",
        tx->rig()));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  SELFCAL_ASSIGN_OR_RETURN(run.base_version, ActiveVersion(tx));
  SELFCAL_ASSIGN_OR_RETURN(run.change, NewestChange(tx));
  run.rig = tx->rig();
  run.run = newest + 1;
  run.trigger = reason.trigger;
  run.create_time_ns = tx->time_ns();
  run.create_steady_ns = tx->now().steady_ns;
  SELFCAL_RETURN_IF_ERROR(InsertRun(tx, run));
  SELFCAL_RETURN_IF_ERROR(AppendEvent(tx,
                                      EventKind::kRunStarted,
                                      fmt::format("run {} on {} segments: {}",
                                                  run.run,
                                                  run.segments.size(),
                                                  reason.text)));
  return run;
}

absl::StatusOr<std::optional<StoredRun>> CreateRunOfTables(
    UnitOfWork* tx, const StoredRig& rig, const std::vector<Table>& tables) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished, UnfinishedRun(tx));
  std::optional<StoredRun> started;
  if (unfinished != 0) {
    return started;
  }
  SELFCAL_ASSIGN_OR_RETURN(const auto last_run, LastRunKeys(tx));
  const Trigger trigger = EvaluateTrigger(rig.rig, tables, last_run);
  if (trigger == Trigger::kNone) {
    return started;
  }
  RunReason reason{RunTrigger::kTablesChanged, "the tables have changed"};
  if (trigger == Trigger::kTablesFull) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t change, NewestChange(tx));
    reason = change > 0
                 ? RunReason{RunTrigger::kChangeDetected,
                             "the tables are full again after a change"}
                 : RunReason{RunTrigger::kTablesFull, "the tables are full"};
  }
  SELFCAL_ASSIGN_OR_RETURN(started, CreateRun(tx, tables, reason));
  return started;
}

absl::StatusOr<StoredRun> CreateManualRun(UnitOfWork* tx, bool force) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           RemoveAgedEntries(tx, rig, tx->now().steady_ns));
  if (!force) {
    SELFCAL_RETURN_IF_ERROR(CheckThatTablesChanged(tx, tables));
  }
  return CreateRun(
      tx, tables, {RunTrigger::kManual, "requested by an operator"});
}

}  // namespace selfcal::server
