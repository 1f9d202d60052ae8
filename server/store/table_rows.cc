#include "server/store/table_rows.h"

#include <algorithm>

#include "server/store/absences.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status ReadEntries(Connection* db, std::int64_t rig, Table* table) {
  Statement read(db,
                 "SELECT s.session, s.session_index, s.sequence, e.entropy, "
                 "  e.gain "
                 "FROM table_entries e JOIN segments s USING (segment) "
                 "WHERE e.rig = ?1 AND e.group_name = ?2 "
                 "ORDER BY e.entropy, s.sequence",
                 rig,
                 table->group);
  while (read.Next()) {
    table->entries.push_back({{read.Text(0), read.Int(1)},
                              read.Int(2),
                              read.Double(3),
                              read.Double(4)});
  }
  return read.status();
}

}  // namespace

absl::Status InsertTables(Connection* db,
                          std::int64_t rig,
                          const std::vector<Table>& tables) {
  int position = 0;
  for (const Table& table : tables) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "INSERT INTO tables (rig, group_name, position, capacity, "
                  "  scored) VALUES (?1, ?2, ?3, ?4, 0)",
                  rig,
                  table.group,
                  position++,
                  table.capacity)
            .Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Table>> ReadTables(Connection* db,
                                              std::int64_t rig) {
  Statement read(db,
                 "SELECT group_name, capacity, scored FROM tables "
                 "WHERE rig = ?1 ORDER BY position",
                 rig);
  std::vector<Table> tables;
  while (read.Next()) {
    Table table;
    table.group = read.Text(0);
    table.capacity = static_cast<int>(read.Int(1));
    table.scored = read.Int(2);
    SELFCAL_RETURN_IF_ERROR(ReadEntries(db, rig, &table));
    tables.push_back(std::move(table));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return tables;
}

absl::StatusOr<std::vector<Table>> ReadFreshTables(Connection* db,
                                                   const RigRow& rig,
                                                   std::int64_t now_ns) {
  const std::int64_t max_age_ns = rig.stored.policy.table_max_age_ns;
  if (max_age_ns > 0) {
    SELFCAL_RETURN_IF_ERROR(
        LeaveTables(db,
                    AbsenceCause::kTooOld,
                    "rig = ?3 AND segment IN (SELECT segment FROM segments "
                    "  WHERE rig = ?3 AND receive_time_ns < ?4)",
                    rig.rowid,
                    now_ns - max_age_ns));
  }
  return ReadTables(db, rig.rowid);
}

absl::StatusOr<std::int64_t> ReceiveTime(Connection* db, std::int64_t segment) {
  return ReadInt(
      db, "SELECT receive_time_ns FROM segments WHERE segment = ?1", segment);
}

absl::Status WriteOffer(Connection* db,
                        std::int64_t rig,
                        const SegmentKey& key,
                        const TableChange& change,
                        const Table& table) {
  SELFCAL_RETURN_IF_ERROR(Statement(db,
                                    "UPDATE tables SET scored = ?3 "
                                    "WHERE rig = ?1 AND group_name = ?2",
                                    rig,
                                    table.group,
                                    table.scored)
                              .Run());
  if (change.evicted) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "DELETE FROM table_entries "
                  "WHERE rig = ?1 AND group_name = ?2 AND segment = "
                  "  (SELECT segment FROM segments WHERE rig = ?1 "
                  "   AND session = ?3 AND session_index = ?4)",
                  rig,
                  table.group,
                  change.evicted->key.session,
                  change.evicted->key.index)
            .Run());
  }
  if (change.inserted) {
    const auto entry = std::find_if(
        table.entries.begin(), table.entries.end(), [&](const TableEntry& e) {
          return e.key == key;
        });
    SELFCAL_RETURN_IF_ERROR(
        Statement(db,
                  "INSERT INTO table_entries (rig, group_name, segment, "
                  "  entropy, gain) "
                  "SELECT ?1, ?2, segment, ?5, ?6 FROM segments "
                  "WHERE rig = ?1 AND session = ?3 AND session_index = ?4",
                  rig,
                  table.group,
                  key.session,
                  key.index,
                  entry->entropy,
                  entry->gain)
            .Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> TablesOfSegment(Connection* db,
                                                         std::int64_t segment) {
  Statement read(db,
                 "SELECT t.group_name FROM table_entries e "
                 "JOIN tables t ON t.rig = e.rig "
                 "  AND t.group_name = e.group_name "
                 "WHERE e.segment = ?1 ORDER BY t.position",
                 segment);
  std::vector<std::string> groups;
  while (read.Next()) {
    groups.push_back(read.Text(0));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return groups;
}

absl::Status WriteEntryScore(Connection* db,
                             std::int64_t segment,
                             const GroupScore& score) {
  return Statement(db,
                   "UPDATE table_entries SET entropy = ?3, gain = ?4 "
                   "WHERE segment = ?1 AND group_name = ?2",
                   segment,
                   score.group,
                   score.entropy,
                   score.gain)
      .Run();
}

absl::Status RemoveFromTables(Connection* db,
                              std::int64_t segment,
                              AbsenceCause cause) {
  return LeaveTables(db, cause, "segment = ?3", segment);
}

}  // namespace selfcal::server
