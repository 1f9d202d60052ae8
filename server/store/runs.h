// Runs of the solver, in the database: written with their trigger and the
// snapshot of the tables, so that a restart finds them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/selection/tables.h"
#include "server/store/rigs.h"
#include "server/store/statement.h"
#include "server/store/store.h"

namespace selfcal::server {

// NOT_FOUND.
absl::StatusOr<StoredRun> ReadRun(Connection* db,
                                  const std::string& rig,
                                  std::int64_t run);
// Newest first.
absl::StatusOr<Listed<StoredRun>> ListRunRows(Connection* db,
                                              const std::string& rig,
                                              const Page& page);
// Of all rigs, oldest first.
absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRunRows(Connection* db);

// The rest runs inside a transaction of the caller.

// FAILED_PRECONDITION if the tables are empty or a run is unfinished.
absl::StatusOr<StoredRun> InsertRun(Connection* db,
                                    const RigRow& rig,
                                    const std::vector<Table>& tables,
                                    RunTrigger trigger);

// Creates the run that the tables call for, if they do and no run is
// unfinished.
absl::StatusOr<std::optional<StoredRun>> MaybeInsertRun(
    Connection* db, const RigRow& rig, const std::vector<Table>& tables);

// What the trigger compares the tables with: the snapshot of the newest run,
// however it ended, so that a failure is not repeated on the same data. Nothing
// until the tables have started a run of their own since the last change: one
// that was asked for on half-filled tables does not stand for the first full
// ones.
absl::StatusOr<std::optional<std::vector<SegmentKey>>> LastRunKeys(
    Connection* db, const RigRow& rig);

// Writes state, attempts, end_time_ns, calibration_version and message; an
// event where the run ends.
absl::Status UpdateRun(Connection* db, std::int64_t rig, const StoredRun& run);

}  // namespace selfcal::server
