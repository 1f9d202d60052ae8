// Runs because a session has ended: the active version shall be computed on the
// tables as the session leaves them, however little has changed since the rule
// of change last fired, and on what is remembered of all segments, once that is
// half as many again.
#include <set>
#include <string_view>

#include "server/store/changes.h"
#include "server/store/clock.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// Of a rig: it has had a run and none is unfinished, no segment waits for its
// score, and the tables hold a segment that the newest run was not created
// with, or have lost one to a quarantine that the run did not bring about; or
// of the segments that a run may use without their data, a third have come
// since the newest run was created.
constexpr std::string_view kChanged =
    "WITH newest AS (SELECT rig, max(run) AS run FROM runs GROUP BY rig) "
    "SELECT r.id FROM rigs r JOIN newest n ON n.rig = r.rig "
    "WHERE ((?1 = '' AND r.last_seen_ns > 0 AND r.last_seen_ns <= ?2) "
    "    OR r.id = ?1) "
    "AND NOT EXISTS (SELECT 1 FROM runs u "
    "  WHERE u.rig = r.rig AND u.state IN (1, 2)) "
    "AND (EXISTS (SELECT 1 FROM table_entries e WHERE e.rig = r.rig "
    "    AND NOT EXISTS (SELECT 1 FROM run_segments x WHERE x.rig = n.rig "
    "      AND x.run = n.run AND x.segment = e.segment)) "
    "  OR EXISTS (SELECT 1 FROM run_segments x JOIN segments s USING (segment) "
    "    WHERE x.rig = n.rig AND x.run = n.run AND x.excluded = 0 "
    "      AND s.state = 3) "
    "  OR (SELECT sum(s.receive_time_ns > u.create_time_ns) > 0 "
    "      AND 3 * sum(s.receive_time_ns > u.create_time_ns) >= count(*) "
    "    FROM segment_ends e JOIN segments s USING (segment) "
    "    JOIN runs u ON u.rig = n.rig AND u.run = n.run "
    "    WHERE e.rig = r.rig AND s.state = 2)) "
    "AND NOT EXISTS (SELECT 1 FROM segments s "
    "  WHERE s.rig = r.rig AND s.state = 1) "
    "ORDER BY r.rig";

// The rig of this name, or those that are idle.
absl::Status AddChanged(Connection* db,
                        const std::string& rig,
                        std::int64_t idle_since_ns,
                        std::set<std::string>* ids) {
  Statement read(db, kChanged, rig, idle_since_ns);
  while (read.Next()) ids->insert(read.Text(0));
  return read.status();
}

}  // namespace

absl::StatusOr<std::vector<StoredRun>> StartSessionRunRows(
    Connection* db,
    const std::vector<std::string>& ended,
    std::int64_t idle_since_ns) {
  Transaction transaction(db);
  SELFCAL_RETURN_IF_ERROR(transaction.status());
  std::set<std::string> ids;
  SELFCAL_RETURN_IF_ERROR(AddChanged(db, "", idle_since_ns, &ids));
  for (const std::string& rig : ended) {
    SELFCAL_RETURN_IF_ERROR(AddChanged(db, rig, 0, &ids));
  }
  std::vector<StoredRun> started;
  for (const std::string& id : ids) {
    const auto rig = ReadRig(db, id);
    if (!rig.ok()) continue;  // a damaged one must not hold up the others
    SELFCAL_ASSIGN_OR_RETURN(const auto last, LastRunKeys(db, *rig));
    SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                             ReadFreshTables(db, *rig, NowNs()));
    if (!last || UnionOfTables(tables).empty()) continue;
    SELFCAL_ASSIGN_OR_RETURN(
        StoredRun run, InsertRun(db, *rig, tables, RunTrigger::kSessionEnded));
    started.push_back(std::move(run));
  }
  SELFCAL_RETURN_IF_ERROR(transaction.Commit());
  return started;
}

}  // namespace selfcal::server
