#include "server/store/runs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <map>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"
#include "server/store/own_rig.h"
#include "server/store/paging.h"
#include "server/store/query_conditions.h"
#include "server/store/rig_lists.h"
#include "server/store/rigs.h"
#include "server/store/row_order.h"

namespace selfcal::server {
namespace {

constexpr char kRunColumns[] =
    "g.id, r.run, r.state, r.started_by, r.create_time_ns, r.end_time_ns, "
    "r.base_version, r.attempts, r.calibration_version, r.message, r.rig, "
    "r.change, r.create_steady_ns, r.end_steady_ns";
constexpr int kRunColumnCount = 14;

// Selects runs `r` of rigs `g`, for RunFromRow; without a condition.
std::string SelectRuns() {
  return fmt::format("SELECT {} FROM runs r JOIN rigs g USING (rig) ",
                     kRunColumns);
}

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

// The columns that state a trigger, with `change`: the column started_by has
// its number. Those that were there first share a cause. Any other one has its
// number in session_ended, beside the cause of a manual run, for which a
// program from before it takes the run.
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

// All but the segments.
StoredRun RunFromRow(const Statement& row) {
  StoredRun run;
  run.rig = row.Text(0);
  run.run = row.Int(1);
  run.state = static_cast<RunState>(row.Int(2));
  run.trigger = static_cast<RunTrigger>(row.Int(3));
  run.create_time_ns = row.Int(4);
  run.end_time_ns = row.Int(5);
  run.base_version = row.Int(6);
  run.attempts = static_cast<int>(row.Int(7));
  run.calibration_version = row.Int(8);
  run.message = row.Text(9);
  run.change = row.Int(11);
  run.create_steady_ns = row.Int(12);
  run.end_steady_ns = row.Int(13);
  return run;
}

// Runs, and the key of each, without their segments.
struct RunRows {
  std::vector<StoredRun> runs;
  std::vector<RunKey> keys;

  void Add(const Statement& row) {
    runs.push_back(RunFromRow(row));
    keys.emplace_back(row.Int(10), runs.back().run);
  }
};

absl::StatusOr<RunRows> ReadRunRows(Statement* read) {
  RunRows rows;
  while (read->Next()) rows.Add(*read);
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

std::string RunListName(const std::string& rig,
                        const RunQuery& query,
                        const RigQuery& of) {
  std::string name =
      rig.empty() ? "runs of many " + FilterText(of) : "runs/" + rig;
  if (query == RunQuery()) return name;
  return fmt::format("{}?{}/{}/{}/{}/{}",
                     name,
                     NumberText(query.state),
                     NumberText(query.trigger),
                     RangeText(query.create_time_ns),
                     static_cast<int>(query.order),
                     query.descending);
}

// The same as that of versions (CalibrationOrder).
RowOrder RunOrder(const std::string& rig, const RunQuery& query) {
  RowOrder order{.columns = {}, .descending = query.descending};
  if (query.order == RunQuery::Order::kDuration) {
    order.columns.emplace_back("r.duration_ns");
  } else if (rig.empty()) {
    order.columns.emplace_back(query == RunQuery() ? "r.create_steady_ns"
                                                   : "r.create_time_ns");
  }
  if (rig.empty()) order.columns.emplace_back("r.rig");
  order.columns.emplace_back("r.run");
  return order;
}

void AndRunQuery(const RunQuery& query, SqlCondition* to) {
  AndIs("r.state", query.state, to);
  AndIs("r.started_by", query.trigger, to);
  AndRange("r.create_time_ns", query.create_time_ns, to);
  // The condition of the index.
  if (query.order == RunQuery::Order::kDuration) {
    to->And("r.duration_ns IS NOT NULL");
  }
}

}  // namespace

absl::StatusOr<StoredRun> ReadRun(Connection* db,
                                  const std::string& rig,
                                  std::int64_t run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(
      db, SelectRuns() + "WHERE r.rig = ?1 AND r.run = ?2", rig_id, run);
  SELFCAL_ASSIGN_OR_RETURN(std::vector<StoredRun> runs, ReadAll(db, &read));
  if (runs.empty()) {
    return absl::NotFoundError(
        fmt::format("rig {} has no recalibration {}", rig, run));
  }
  return std::move(runs.front());
}

absl::StatusOr<Listed<StoredRun>> ListRunRows(Connection* db,
                                              const std::string& rig,
                                              const RunQuery& query,
                                              const Page& page,
                                              const RigQuery& of) {
  const std::string list = RunListName(rig, query, of);
  const RowOrder order = RunOrder(rig, query);
  SELFCAL_ASSIGN_OR_RETURN(const RowPlace place, RowPlaceOf(list, order, page));
  SqlCondition condition;
  if (!rig.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
    condition.And("r.rig = " + condition.Parameter(rig_id));
  }
  AndRunQuery(query, &condition);
  AndAfter(order, place, &condition);
  if (rig.empty()) AddRigConditions(of, "g", &condition);
  const int size = PageSize(page);
  const std::string limit = condition.Parameter(std::int64_t{size + 1});
  Statement read(db,
                 condition.reuse(),
                 fmt::format("SELECT {}, {} FROM runs r JOIN rigs g "
                             "USING (rig) WHERE {} ORDER BY {} LIMIT {}",
                             kRunColumns,
                             fmt::join(order.columns, ", "),
                             condition.sql(),
                             OrderText(order),
                             limit));
  condition.Bind(&read);
  Listed<StoredRun> listed;
  RunRows rows;
  SELFCAL_ASSIGN_OR_RETURN(
      listed.next_token,
      ReadPage(
          list, order, kRunColumnCount, size, &read, [&](const Statement& row) {
            rows.Add(row);
          }));
  SELFCAL_ASSIGN_OR_RETURN(listed.items, Complete(db, std::move(rows)));
  return listed;
}

absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRunRows(
    Connection* db, const std::string& replica) {
  Statement read(db,
                 SelectRuns() +
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
