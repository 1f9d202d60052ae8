// Records of runs of the solver: with their trigger and the snapshot of the
// tables, so that a restart finds them.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

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

// --- Within a unit of work.

// NOT_FOUND.
absl::StatusOr<StoredRun> ReadRun(UnitOfWork* tx, std::int64_t run);

// Numbers of runs of the rig; 0: there is none.
absl::StatusOr<std::int64_t> NewestRun(UnitOfWork* tx);
absl::StatusOr<std::int64_t> UnfinishedRun(UnitOfWork* tx);
absl::StatusOr<std::int64_t> NewestSucceededRun(UnitOfWork* tx);
// That the tables started by themselves since this change of the device.
absl::StatusOr<std::int64_t> NewestRunOfTables(UnitOfWork* tx,
                                               std::int64_t change);

// With its snapshot of segments; pending.
absl::Status InsertRun(UnitOfWork* tx, const StoredRun& run);
// Writes state, attempts, end_time_ns, calibration_version and message.
absl::Status UpdateRun(UnitOfWork* tx, const StoredRun& run);
// The result of the run does not use this segment of its snapshot.
absl::Status MarkExcluded(UnitOfWork* tx,
                          std::int64_t run,
                          std::int64_t segment);
// Segments of the snapshot that the result uses, by key.
absl::StatusOr<std::vector<SegmentKey>> UsedSegments(UnitOfWork* tx,
                                                     std::int64_t run);
// Segments of the snapshot that are unusable by now, in order of arrival: all,
// or those that the result uses.
absl::StatusOr<std::vector<SegmentKey>> UnusableSegments(UnitOfWork* tx,
                                                         std::int64_t run,
                                                         bool only_used);

}  // namespace selfcal::server
