// Records of the tables of the most informative segments.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/selection/tables.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Tables in the order of the rig's groups, with the entries sorted as Table
// says.
absl::StatusOr<std::vector<Table>> ReadTables(Connection* db, std::int64_t rig);
// The same of several rigs, by their keys.
absl::StatusOr<std::map<std::int64_t, std::vector<Table>>> ReadTables(
    Connection* db, const std::vector<std::int64_t>& rigs);
// Groups whose table holds the segment, in the order of the rig.
absl::StatusOr<std::vector<std::string>> TablesOfSegment(Connection* db,
                                                         std::int64_t rig,
                                                         std::int64_t sequence);

// --- Within a unit of work.

// Inserts empty tables.
absl::Status InsertTables(UnitOfWork* tx, const std::vector<Table>& tables);
absl::StatusOr<std::vector<Table>> ReadTables(UnitOfWork* tx);
absl::StatusOr<std::vector<std::string>> TablesOfSegment(UnitOfWork* tx,
                                                         std::int64_t sequence);
// Writes how many scored segments a table was offered.
absl::Status WriteScored(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t scored);
absl::Status InsertEntry(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t sequence,
                         double entropy,
                         double gain);
absl::Status DeleteEntry(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t sequence);
// Replaces the score of a segment in the table of its group, if that holds it.
absl::Status WriteEntryScore(UnitOfWork* tx,
                             std::int64_t sequence,
                             const GroupScore& score);

}  // namespace selfcal::server
