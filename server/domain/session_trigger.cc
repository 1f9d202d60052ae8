#include "server/domain/session_trigger.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "server/domain/retention.h"
#include "server/domain/run_creation.h"
#include "server/status/status_macros.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// A run is worth its cost once one in this many of the remembered segments
// arrived after the last run.
constexpr std::int64_t kOneOf = 3;

absl::StatusOr<bool> MemoryHasGrown(UnitOfWork* tx, const StoredRun& run) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> arrivals,
                           ArrivalsOfEnds(tx));
  const auto newer =
      std::count_if(arrivals.begin(), arrivals.end(), [&](auto steady_ns) {
        return steady_ns > run.create_steady_ns;
      });
  return newer > 0 && kOneOf * newer >= std::ssize(arrivals);
}

absl::StatusOr<bool> IsSessionRunDue(UnitOfWork* tx) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestRun(tx));
  if (newest == 0) return false;
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t unfinished, UnfinishedRun(tx));
  SELFCAL_ASSIGN_OR_RETURN(const bool unscored, HasUnscored(tx));
  if (unfinished != 0 || unscored) return false;
  SELFCAL_ASSIGN_OR_RETURN(const auto last, LastRunKeys(tx));
  if (!last) return false;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun run, ReadRun(tx, newest));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables, ReadTables(tx));
  if (HoldAnother(tables, run)) return true;
  SELFCAL_ASSIGN_OR_RETURN(const auto unusable,
                           UnusableSegments(tx, newest, true));
  if (!unusable.empty()) return true;
  return MemoryHasGrown(tx, run);
}

}  // namespace

absl::StatusOr<std::optional<StoredRun>> CreateSessionRun(UnitOfWork* tx) {
  std::optional<StoredRun> started;
  SELFCAL_ASSIGN_OR_RETURN(const bool due, IsSessionRunDue(tx));
  if (!due) return started;
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, ReadRig(tx));
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables,
                           RemoveAgedEntries(tx, rig, tx->now().steady_ns));
  if (UnionOfTables(tables).empty()) return started;
  SELFCAL_ASSIGN_OR_RETURN(
      started,
      CreateRun(tx,
                tables,
                {RunTrigger::kSessionEnded,
                 "the session has ended, and the tables have changed"}));
  return started;
}

}  // namespace selfcal::server
