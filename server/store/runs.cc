#include "server/store/runs.h"

#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/own_rig.h"
#include "server/store/paging.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"
#include "server/store/time_place.h"

namespace selfcal::server {
namespace {

constexpr char kRunColumns[] =
    "SELECT g.id, r.run, r.state, r.cause, r.create_time_ns, r.end_time_ns, "
    "  r.base_version, r.attempts, r.calibration_version, r.message, r.rig, "
    "  r.change, r.session_ended, r.create_steady_ns, r.end_steady_ns "
    "FROM runs r JOIN rigs g USING (rig) ";

absl::StatusOr<std::vector<SegmentKey>> ReadKeys(Statement* read) {
  std::vector<SegmentKey> keys;
  while (read->Next()) keys.push_back({read->Text(0), read->Int(1)});
  SELFCAL_RETURN_IF_ERROR(read->status());
  return keys;
}

// Runs whose snapshots are read together: an engine limits the parameters of a
// statement.
constexpr std::size_t kSnapshotsAtOnce = 1000;

// A run is its rig's key and its number.
using RunKey = std::pair<std::int64_t, std::int64_t>;

// Adds the segments of the snapshots to these runs.
absl::Status ReadSnapshots(Connection* db,
                           const std::map<RunKey, StoredRun*>& runs) {
  std::vector<std::vector<SqlCondition::Value>> keys;
  for (const auto& [key, run] : runs) keys.push_back({key.first, key.second});
  SqlCondition condition;
  condition.AndIn("(x.rig, x.run)", keys);
  Statement read(db,
                 condition.reuse(),
                 "SELECT x.rig, x.run, s.session, s.session_index "
                 "FROM run_segments x CROSS JOIN segments s "
                 "WHERE s.rig = x.rig AND s.sequence = x.sequence AND " +
                     condition.sql() + " ORDER BY x.rig, x.run, x.sequence");
  condition.Bind(&read);
  while (read.Next()) {
    runs.at({read.Int(0), read.Int(1)})
        ->segments.push_back({read.Text(2), read.Int(3)});
  }
  return read.status();
}

// How the columns cause and session_ended state a trigger. Those that were
// there first share a cause. Any other one has its number in session_ended,
// beside the cause of a manual run, for which a program from before it takes
// the run.
struct TriggerColumns {
  std::int64_t cause = 0;
  std::int64_t session_ended = 0;
};

TriggerColumns ColumnsOf(RunTrigger trigger) {
  switch (trigger) {
    case RunTrigger::kTablesFull:
    case RunTrigger::kChangeDetected:
      return {1, 0};
    case RunTrigger::kTablesChanged:
      return {2, 0};
    case RunTrigger::kSessionEnded:
      return {2, 1};
    case RunTrigger::kManual:
      return {3, 0};
    case RunTrigger::kCalibrationAged:
      return {4, 0};
  }
  return {3, static_cast<std::int64_t>(trigger)};
}

// `change` tells two triggers with the same columns apart.
RunTrigger TriggerOf(const TriggerColumns& columns, std::int64_t change) {
  switch (columns.cause) {
    case 1:
      return change > 0 ? RunTrigger::kChangeDetected : RunTrigger::kTablesFull;
    case 2:
      return columns.session_ended != 0 ? RunTrigger::kSessionEnded
                                        : RunTrigger::kTablesChanged;
    case 4:
      return RunTrigger::kCalibrationAged;
    default:
      return columns.session_ended != 0
                 ? static_cast<RunTrigger>(columns.session_ended)
                 : RunTrigger::kManual;
  }
}

// All but the segments.
StoredRun RunFromRow(const Statement& row) {
  StoredRun run;
  run.rig = row.Text(0);
  run.run = row.Int(1);
  run.state = static_cast<RunState>(row.Int(2));
  run.trigger = TriggerOf({row.Int(3), row.Int(12)}, row.Int(11));
  run.create_time_ns = row.Int(4);
  run.end_time_ns = row.Int(5);
  run.base_version = row.Int(6);
  run.attempts = static_cast<int>(row.Int(7));
  run.calibration_version = row.Int(8);
  run.message = row.Text(9);
  run.change = row.Int(11);
  run.create_steady_ns = row.Int(13);
  run.end_steady_ns = row.Int(14);
  return run;
}

// Runs, and the key of each, without their segments.
struct RunRows {
  std::vector<StoredRun> runs;
  std::vector<RunKey> keys;
};

absl::StatusOr<RunRows> ReadRunRows(Statement* read) {
  RunRows rows;
  while (read->Next()) {
    rows.runs.push_back(RunFromRow(*read));
    rows.keys.emplace_back(read->Int(10), rows.runs.back().run);
  }
  SELFCAL_RETURN_IF_ERROR(read->status());
  return rows;
}

// The runs of the rows with their segments.
absl::StatusOr<std::vector<StoredRun>> Complete(Connection* db, RunRows rows) {
  std::map<RunKey, StoredRun*> some;
  for (std::size_t k = 0; k < rows.runs.size(); ++k) {
    some[rows.keys[k]] = &rows.runs[k];
    if (some.size() < kSnapshotsAtOnce && k + 1 < rows.runs.size()) continue;
    SELFCAL_RETURN_IF_ERROR(ReadSnapshots(db, some));
    some.clear();
  }
  return std::move(rows.runs);
}

absl::StatusOr<std::vector<StoredRun>> ReadAll(Connection* db,
                                               Statement* read) {
  SELFCAL_ASSIGN_OR_RETURN(RunRows rows, ReadRunRows(read));
  return Complete(db, std::move(rows));
}

absl::StatusOr<std::int64_t> NewestWhere(UnitOfWork* tx,
                                         const std::string& condition) {
  return ReadInt(
      tx->db(),
      "SELECT coalesce(max(run), 0) FROM runs WHERE rig = ?1 AND " + condition,
      tx->rig_row());
}

absl::StatusOr<Listed<StoredRun>> ListRunsOfMany(Connection* db,
                                                 const Page& page,
                                                 const RigQuery& of) {
  const std::string list = "runs of many " + FilterText(of);
  SELFCAL_ASSIGN_OR_RETURN(const TimePlace place, TimePlaceOf(list, page));
  const int size = PageSize(page);
  SqlCondition condition(5);
  AddRigConditions(of, "g", &condition);
  Statement read(db,
                 condition.reuse(),
                 std::string(kRunColumns) +
                     "WHERE (r.create_steady_ns, r.rig, r.run) < (?1, ?2, ?3) "
                     "AND " +
                     condition.sql() +
                     " ORDER BY r.create_steady_ns DESC, r.rig DESC, "
                     "  r.run DESC LIMIT ?4",
                 place.steady_ns,
                 place.rig,
                 place.number,
                 size + 1);
  condition.Bind(&read);
  SELFCAL_ASSIGN_OR_RETURN(RunRows rows, ReadRunRows(&read));
  Listed<StoredRun> listed;
  if (static_cast<int>(rows.runs.size()) > size) {
    rows.runs.pop_back();
    const auto [rig_key, run] = rows.keys[rows.runs.size() - 1];
    listed.next_token =
        TokenAfter(list, {rows.runs.back().create_steady_ns, rig_key, run});
  }
  SELFCAL_ASSIGN_OR_RETURN(listed.items, Complete(db, std::move(rows)));
  return listed;
}

}  // namespace

absl::StatusOr<StoredRun> ReadRun(Connection* db,
                                  const std::string& rig,
                                  std::int64_t run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 std::string(kRunColumns) + "WHERE r.rig = ?1 AND r.run = ?2",
                 rig_id,
                 run);
  SELFCAL_ASSIGN_OR_RETURN(std::vector<StoredRun> runs, ReadAll(db, &read));
  if (runs.empty()) {
    return absl::NotFoundError(
        fmt::format("rig {} has no recalibration {}", rig, run));
  }
  return std::move(runs.front());
}

absl::StatusOr<Listed<StoredRun>> ListRunRows(Connection* db,
                                              const std::string& rig,
                                              const Page& page,
                                              const RigQuery& of) {
  if (rig.empty()) return ListRunsOfMany(db, page, of);
  const std::string list = "runs/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  const int size = PageSize(page);
  Statement read(db,
                 std::string(kRunColumns) +
                     "WHERE r.rig = ?1 AND r.run < ?2 "
                     "ORDER BY r.run DESC LIMIT ?3",
                 rig_id,
                 before.value_or(INT64_MAX),
                 size + 1);
  Listed<StoredRun> listed;
  SELFCAL_ASSIGN_OR_RETURN(listed.items, ReadAll(db, &read));
  CutPage(
      list, size, [](const auto& item) { return item.run; }, &listed);
  return listed;
}

absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRunRows(
    Connection* db, const std::string& replica) {
  Statement read(db,
                 std::string(kRunColumns) +
                     "WHERE r.state IN (1, 2) AND (?1 = '' OR EXISTS "
                     "  (SELECT 1 FROM claims c "
                     "   WHERE c.rig = r.rig AND c.replica = ?1)) AND " +
                     IsOwnRig("r.rig") +
                     " "
                     "ORDER BY r.create_steady_ns, r.rig, r.run",
                 replica);
  return ReadAll(db, &read);
}

absl::StatusOr<StoredRun> ReadRun(UnitOfWork* tx, std::int64_t run) {
  return ReadRun(tx->db(), tx->rig(), run);
}

absl::StatusOr<std::int64_t> NewestRun(UnitOfWork* tx) {
  return NewestWhere(tx, "TRUE");
}

absl::StatusOr<std::int64_t> UnfinishedRun(UnitOfWork* tx) {
  return NewestWhere(tx, "state IN (1, 2)");
}

absl::StatusOr<std::int64_t> NewestSucceededRun(UnitOfWork* tx) {
  return NewestWhere(tx, "state = 3");
}

absl::StatusOr<std::int64_t> NewestRunOf(
    UnitOfWork* tx,
    std::initializer_list<RunTrigger> triggers,
    std::int64_t change) {
  std::vector<std::string> any;
  for (const RunTrigger trigger : triggers) {
    const TriggerColumns columns = ColumnsOf(trigger);
    any.push_back(fmt::format("(cause = {} AND session_ended = {})",
                              columns.cause,
                              columns.session_ended));
  }
  return NewestWhere(
      tx, fmt::format("change = {} AND ({})", change, fmt::join(any, " OR ")));
}

absl::Status InsertRun(UnitOfWork* tx, const StoredRun& run) {
  tx->Changed(RecordKind::kRun, run.run);
  const TriggerColumns columns = ColumnsOf(run.trigger);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO runs (rig, run, state, cause, create_time_ns, "
                "  base_version, change, session_ended, create_steady_ns) "
                "VALUES (?1, ?2, 1, ?3, ?4, ?5, ?6, ?7, ?8)",
                tx->rig_row(),
                run.run,
                columns.cause,
                run.create_time_ns,
                run.base_version,
                run.change,
                columns.session_ended,
                run.create_steady_ns)
          .Run());
  for (const SegmentKey& key : run.segments) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  "INSERT INTO run_segments (rig, run, sequence) "
                  "SELECT rig, ?2, sequence FROM segments "
                  "WHERE rig = ?1 AND session = ?3 AND session_index = ?4",
                  tx->rig_row(),
                  run.run,
                  key.session,
                  key.index)
            .Run());
  }
  return AnnounceRun(tx, run.run);
}

absl::Status UpdateRun(UnitOfWork* tx, const StoredRun& run) {
  tx->Changed(RecordKind::kRun, run.run);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "UPDATE runs SET state = ?3, attempts = ?4, "
                "  end_time_ns = ?5, calibration_version = ?6, "
                "  message = ?7, end_steady_ns = ?8 "
                "WHERE rig = ?1 AND run = ?2",
                tx->rig_row(),
                run.run,
                static_cast<int>(run.state),
                run.attempts,
                run.end_time_ns,
                run.calibration_version,
                run.message,
                run.end_steady_ns)
          .Run());
  return AnnounceRun(tx, run.run);
}

absl::Status MarkExcluded(UnitOfWork* tx,
                          std::int64_t run,
                          std::int64_t sequence) {
  tx->Changed(RecordKind::kRun, run);
  return Statement(tx->db(),
                   "UPDATE run_segments SET excluded = 1 "
                   "WHERE rig = ?1 AND run = ?2 AND sequence = ?3",
                   tx->rig_row(),
                   run,
                   sequence)
      .Run();
}

absl::StatusOr<std::vector<SegmentKey>> UsedSegments(UnitOfWork* tx,
                                                     std::int64_t run) {
  Statement read(tx->db(),
                 "SELECT s.session, s.session_index FROM run_segments x "
                 "CROSS JOIN segments s "
                 "WHERE s.rig = x.rig AND s.sequence = x.sequence "
                 "AND x.rig = ?1 AND x.run = ?2 AND x.excluded = 0 "
                 "ORDER BY s.session, s.session_index",
                 tx->rig_row(),
                 run);
  return ReadKeys(&read);
}

absl::StatusOr<std::vector<SegmentKey>> UnusableSegments(UnitOfWork* tx,
                                                         std::int64_t run,
                                                         bool only_used) {
  Statement read(tx->db(),
                 "SELECT s.session, s.session_index FROM run_segments x "
                 "CROSS JOIN segments s "
                 "WHERE s.rig = x.rig AND s.sequence = x.sequence "
                 "AND x.rig = ?1 AND x.run = ?2 AND s.state = 3 "
                 "AND (?3 = 0 OR x.excluded = 0) ORDER BY x.sequence",
                 tx->rig_row(),
                 run,
                 only_used ? 1 : 0);
  return ReadKeys(&read);
}

}  // namespace selfcal::server
