// Records of runs: with their trigger and their snapshot of the tables, so that
// a restart finds them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// NOT_FOUND.
absl::StatusOr<StoredRun> ReadRun(Connection* db,
                                  const std::string& rig,
                                  std::int64_t run);
// Store::ListRuns.
absl::StatusOr<Listed<StoredRun>> ListRunRows(Connection* db,
                                              const std::string& rig,
                                              const RunQuery& query,
                                              const Page& page,
                                              const RigQuery& of);
// Store::ListUnfinishedRuns.
absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRunRows(
    Connection* db, const std::string& replica);

// --- Within a unit of work.

// NOT_FOUND.
absl::StatusOr<StoredRun> ReadRun(UnitOfWork* tx, std::int64_t run);

// The number of the newest such run of the rig; 0 if there is none.
absl::StatusOr<std::int64_t> NewestRun(UnitOfWork* tx);
absl::StatusOr<std::int64_t> UnfinishedRun(UnitOfWork* tx);
absl::StatusOr<std::int64_t> NewestSucceededRun(UnitOfWork* tx);
// Of those with one of these triggers, since this device change.
absl::StatusOr<std::int64_t> NewestRunOf(
    UnitOfWork* tx,
    std::initializer_list<RunTrigger> triggers,
    std::int64_t change);

// Writes a pending run with its snapshot of segments.
absl::Status InsertRun(UnitOfWork* tx, const StoredRun& run);
// Writes state, attempts, end (by both clocks), calibration_version, message.
absl::Status UpdateRun(UnitOfWork* tx, const StoredRun& run);
// Records that the result of the run does not use this segment of its snapshot.
absl::Status MarkExcluded(UnitOfWork* tx,
                          std::int64_t run,
                          std::int64_t sequence);
// Segments of the snapshot that the result uses, ordered by key.
absl::StatusOr<std::vector<SegmentKey>> UsedSegments(UnitOfWork* tx,
                                                     std::int64_t run);
// Segments of the snapshot that have become unusable, in order of arrival: all
// of them, or only those that the result uses.
absl::StatusOr<std::vector<SegmentKey>> UnusableSegments(UnitOfWork* tx,
                                                         std::int64_t run,
                                                         bool only_used);

}  // namespace selfcal::server
