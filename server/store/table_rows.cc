#include "server/store/table_rows.h"

#include <algorithm>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {
namespace {

// Reads the entries of the tables of these rigs.
absl::Status ReadEntries(Connection* db,
                         const SqlCondition& of_rigs,
                         std::map<std::int64_t, std::vector<Table>>* tables) {
  Statement read(db,
                 of_rigs.reuse(),
                 "SELECT t.rig, t.group_name, s.session, s.session_index, "
                 "  s.sequence, t.entropy, t.gain, s.temperature_c "
                 "FROM table_entries t CROSS JOIN segments s "
                 "WHERE s.rig = t.rig AND s.sequence = t.sequence AND " +
                     of_rigs.sql());
  of_rigs.Bind(&read);
  while (read.Next()) {
    for (Table& table : tables->at(read.Int(0))) {
      if (table.group != read.Text(1)) continue;
      table.entries.push_back({{read.Text(2), read.Int(3)},
                               read.Int(4),
                               read.Double(5),
                               read.Double(6)});
      if (read.IsNull(7)) continue;
      table.entries.back().temperature_c = read.Double(7);
    }
  }
  for (auto& [rig, of_rig] : *tables) {
    for (Table& table : of_rig) {
      std::sort(table.entries.begin(), table.entries.end(), Better);
    }
  }
  return read.status();
}

}  // namespace

absl::StatusOr<std::map<std::int64_t, std::vector<Table>>> ReadTables(
    Connection* db, const std::vector<std::int64_t>& rigs) {
  std::map<std::int64_t, std::vector<Table>> tables;
  if (rigs.empty()) return tables;
  SqlCondition of_rigs;
  of_rigs.AndOneOf("t.rig", rigs);
  Statement read(db,
                 of_rigs.reuse(),
                 "SELECT t.rig, t.group_name, t.capacity, t.scored "
                 "FROM tables t WHERE " +
                     of_rigs.sql() + " ORDER BY t.rig, t.position");
  of_rigs.Bind(&read);
  while (read.Next()) {
    Table& table = tables[read.Int(0)].emplace_back();
    table.group = read.Text(1);
    table.capacity = static_cast<int>(read.Int(2));
    table.scored = read.Int(3);
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  SELFCAL_RETURN_IF_ERROR(ReadEntries(db, of_rigs, &tables));
  return tables;
}

absl::StatusOr<std::vector<Table>> ReadTables(Connection* db,
                                              std::int64_t rig) {
  SELFCAL_ASSIGN_OR_RETURN(auto tables, ReadTables(db, std::vector{rig}));
  return std::move(tables[rig]);
}

absl::StatusOr<std::vector<std::string>> TablesOfSegment(
    Connection* db, std::int64_t rig, std::int64_t sequence) {
  Statement read(db,
                 "SELECT t.group_name FROM table_entries e "
                 "JOIN tables t ON t.rig = e.rig "
                 "  AND t.group_name = e.group_name "
                 "WHERE e.rig = ?1 AND e.sequence = ?2 ORDER BY t.position",
                 rig,
                 sequence);
  std::vector<std::string> groups;
  while (read.Next()) {
    groups.push_back(read.Text(0));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return groups;
}

absl::Status InsertTables(UnitOfWork* tx, const std::vector<Table>& tables) {
  tx->Changed(RecordKind::kTables);
  int position = 0;
  for (const Table& table : tables) {
    SELFCAL_RETURN_IF_ERROR(
        Statement(tx->db(),
                  "INSERT INTO tables (rig, group_name, position, capacity, "
                  "  scored) VALUES (?1, ?2, ?3, ?4, 0)",
                  tx->rig_row(),
                  table.group,
                  position++,
                  table.capacity)
            .Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Table>> ReadTables(UnitOfWork* tx) {
  return ReadTables(tx->db(), tx->rig_row());
}

absl::StatusOr<std::vector<std::string>> TablesOfSegment(
    UnitOfWork* tx, std::int64_t sequence) {
  return TablesOfSegment(tx->db(), tx->rig_row(), sequence);
}

absl::Status WriteScored(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t scored) {
  tx->Changed(RecordKind::kTables);
  return Statement(tx->db(),
                   "UPDATE tables SET scored = ?3 "
                   "WHERE rig = ?1 AND group_name = ?2",
                   tx->rig_row(),
                   group,
                   scored)
      .Run();
}

absl::Status InsertEntry(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t sequence,
                         double entropy,
                         double gain) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "INSERT INTO table_entries (rig, group_name, sequence, "
                   "  entropy, gain) VALUES (?1, ?2, ?3, ?4, ?5)",
                   tx->rig_row(),
                   group,
                   sequence,
                   entropy,
                   gain)
      .Run();
}

absl::Status DeleteEntry(UnitOfWork* tx,
                         const std::string& group,
                         std::int64_t sequence) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "DELETE FROM table_entries "
                   "WHERE rig = ?1 AND group_name = ?2 AND sequence = ?3",
                   tx->rig_row(),
                   group,
                   sequence)
      .Run();
}

absl::Status WriteEntryScore(UnitOfWork* tx,
                             std::int64_t sequence,
                             const GroupScore& score) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "UPDATE table_entries SET entropy = ?4, gain = ?5 "
                   "WHERE rig = ?1 AND group_name = ?2 AND sequence = ?3",
                   tx->rig_row(),
                   score.group,
                   sequence,
                   score.entropy,
                   score.gain)
      .Run();
}

}  // namespace selfcal::server
