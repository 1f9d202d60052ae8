// The tables of the most informative segments, in the database.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/selection/tables.h"
#include "server/store/rigs.h"
#include "server/store/statement.h"

namespace selfcal::server {

// New ones, empty.
absl::Status InsertTables(Connection* db,
                          std::int64_t rig,
                          const std::vector<Table>& tables);

// In the order of the rig's groups, entries sorted as Table says.
absl::StatusOr<std::vector<Table>> ReadTables(Connection* db, std::int64_t rig);

// The same, after segments that are too old at that time by the policy of the
// rig have left them.
absl::StatusOr<std::vector<Table>> ReadFreshTables(Connection* db,
                                                   const RigRow& rig,
                                                   std::int64_t now_ns);

// When the segment arrived.
absl::StatusOr<std::int64_t> ReceiveTime(Connection* db, std::int64_t segment);

// Writes that one scored segment was offered to `table` (core/selection), and
// what that changed.
absl::Status WriteOffer(Connection* db,
                        std::int64_t rig,
                        const SegmentKey& key,
                        const TableChange& change,
                        const Table& table);

// Groups whose table holds the segment, in the order of the rig.
absl::StatusOr<std::vector<std::string>> TablesOfSegment(Connection* db,
                                                         std::int64_t segment);

// A later score of a segment in the table of its group, if that holds it.
absl::Status WriteEntryScore(Connection* db,
                             std::int64_t segment,
                             const GroupScore& score);

// Takes a segment out of every table that holds it.
absl::Status RemoveFromTables(Connection* db,
                              std::int64_t segment,
                              AbsenceCause cause);

}  // namespace selfcal::server
