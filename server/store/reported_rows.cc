#include "server/store/reported_rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {
namespace {

using Value = store::ReportedRecords::Value;

// Binds the column rig: an event has the name there, others the key.
void BindRig(const ReportedTable& table, UnitOfWork* tx, Statement* statement) {
  if (table.kind == RecordKind::kEvent) {
    statement->BindNext(tx->rig());
  } else {
    statement->BindNext(tx->rig_row());
  }
}

// Binds the rig and, if the table has one, the number.
void BindRecord(const ReportedTable& table,
                UnitOfWork* tx,
                std::int64_t number,
                Statement* statement) {
  BindRig(table, tx, statement);
  if (!table.number.empty()) statement->BindNext(number);
}

std::string WhereRecord(const ReportedTable& table) {
  return table.number.empty()
             ? "WHERE rig = ?1"
             : fmt::format("WHERE rig = ?1 AND {} = ?2", table.number);
}

std::vector<std::string_view> NamesOf(
    const std::vector<ReportedColumn>& columns) {
  std::vector<std::string_view> names;
  for (const ReportedColumn& column : columns) names.push_back(column.name);
  return names;
}

void PutValue(const Statement& read, int column, ColumnType type, Value* to) {
  if (read.IsNull(column)) return;
  switch (type) {
    case ColumnType::kInteger:
      return to->set_integer(read.Int(column));
    case ColumnType::kReal:
      return to->set_real(read.Double(column));
    case ColumnType::kText:
      return to->set_text(read.Text(column));
    case ColumnType::kBlob:
      return to->set_blob(read.Text(column));
  }
}

// True if the blob of the row is not what its checksum, in a later column,
// says.
bool IsDamaged(const ReportedTable& table,
               const store::ReportedRecords::Row& row) {
  const std::string* blob = nullptr;
  for (int c = 0; c < row.values_size(); ++c) {
    if (table.columns[c].type != ColumnType::kBlob) continue;
    const std::string& value = row.values(c).blob();
    if (table.columns[c].name == "sha256") {
      return blob != nullptr && Sha256(*blob) != value;
    }
    blob = &value;
  }
  return false;
}

// The hub would refuse what is damaged, and with it all that follows. Of a
// segment it is left out, so that the hub has as little of it as the device;
// anything else that is damaged, the device cannot do without either.
bool CanBeLeftOut(const ReportedTable& table) {
  return table.kind == RecordKind::kData ||
         (table.kind == RecordKind::kSegment && table.name != "segments");
}

absl::Status PutRows(UnitOfWork* tx,
                     const ReportedTable& table,
                     int index,
                     std::int64_t number,
                     store::ReportedRecords::Record* record) {
  const std::string order =
      table.key.empty()
          ? ""
          : fmt::format(" ORDER BY {}", fmt::join(table.key, ", "));
  Statement read(tx->db(),
                 fmt::format("SELECT {} FROM {} {}{}",
                             fmt::join(NamesOf(table.columns), ", "),
                             table.name,
                             WhereRecord(table),
                             order));
  BindRecord(table, tx, number, &read);
  while (read.Next()) {
    auto* row = record->add_rows();
    row->set_table(index);
    int column = 0;
    for (const ReportedColumn& of : table.columns) {
      PutValue(read, column++, of.type, row->add_values());
    }
    if (CanBeLeftOut(table) && IsDamaged(table, *row)) {
      record->mutable_rows()->RemoveLast();
    }
  }
  return read.status();
}

bool HasType(const Value& value, ColumnType type) {
  switch (value.value_case()) {
    case Value::VALUE_NOT_SET:
      return true;
    case Value::kInteger:
      return type == ColumnType::kInteger;
    case Value::kReal:
      return type == ColumnType::kReal;
    case Value::kText:
      return type == ColumnType::kText;
    case Value::kBlob:
      return type == ColumnType::kBlob;
  }
  return false;
}

absl::Status Unknown(const std::string& what) {
  return absl::InvalidArgumentError(fmt::format(
      "this hub does not know {} of a report: upgrade the hub before its "
      "devices",
      what));
}

void BindValue(const Value& value, Statement* to) {
  switch (value.value_case()) {
    case Value::kInteger:
      return to->BindNext(std::int64_t{value.integer()});
    case Value::kReal:
      return to->BindNext(value.real());
    case Value::kText:
      return to->BindNext(value.text());
    case Value::kBlob:
      return to->BindNext(BlobView{value.blob()});
    case Value::VALUE_NOT_SET:
      return to->BindNext(std::optional<std::int64_t>());
  }
}

// The blobs of a row, against its checksum.
absl::Status CheckBlobs(const ReportedRow& row) {
  constexpr std::string_view kChecksum = "sha256";
  const Value& checksum = row.Of(kChecksum);
  if (!checksum.has_blob()) return absl::OkStatus();
  for (std::size_t k = 0; k < row.values.size(); ++k) {
    const ReportedColumn& column = row.table->columns[k];
    if (column.type != ColumnType::kBlob || column.name == kChecksum) continue;
    const bool intact =
        row.values[k] != nullptr &&
        VerifySha256(row.values[k]->blob(), checksum.blob(), "").ok();
    if (intact) continue;
    return absl::InvalidArgumentError(
        fmt::format("{}.{} of a report does not match its checksum",
                    row.table->name,
                    column.name));
  }
  return absl::OkStatus();
}

// A row without the columns that the device does not have.
struct Written {
  std::vector<std::string_view> columns;
  std::vector<const Value*> values;
};

Written WrittenOf(const ReportedRow& row) {
  Written written;
  for (std::size_t k = 0; k < row.values.size(); ++k) {
    if (row.values[k] == nullptr) continue;
    written.columns.push_back(row.table->columns[k].name);
    written.values.push_back(row.values[k]);
  }
  return written;
}

// The treatment of a row that is there already.
std::string ConflictClause(const ReportedRow& row,
                           const std::vector<std::string_view>& columns,
                           OnConflict on_conflict) {
  if (on_conflict == OnConflict::kKeep) return "ON CONFLICT DO NOTHING";
  std::vector<std::string> identity = {"rig"};
  if (!row.table->number.empty()) identity.emplace_back(row.table->number);
  std::vector<std::string> updates;
  for (const std::string_view key : row.table->key) identity.emplace_back(key);
  for (const std::string_view column : columns) {
    if (std::find(identity.begin(), identity.end(), column) == identity.end()) {
      updates.push_back(fmt::format("{0} = excluded.{0}", column));
    }
  }
  // All of its columns identify it.
  if (updates.empty()) return "ON CONFLICT DO NOTHING";
  return fmt::format("ON CONFLICT ({}) DO UPDATE SET {}",
                     fmt::join(identity, ", "),
                     fmt::join(updates, ", "));
}

}  // namespace

absl::StatusOr<std::vector<std::int64_t>> NumbersOf(UnitOfWork* tx,
                                                    RecordKind kind) {
  std::vector<std::int64_t> numbers;
  // The first table of a kind has a row for each record.
  const auto table =
      std::find_if(ReportedTables().begin(),
                   ReportedTables().end(),
                   [&](const ReportedTable& t) { return t.kind == kind; });
  if (table == ReportedTables().end() || table->number.empty()) {
    numbers.push_back(0);
    return numbers;
  }
  // Those of an earlier rig of this name are not of this one.
  const std::string_view condition =
      kind == RecordKind::kEvent
          ? "AND event > (SELECT r.earlier_events FROM rigs r WHERE r.id = ?1) "
          : "";
  Statement read(
      tx->db(),
      fmt::format("SELECT {0} FROM {1} WHERE rig = ?1 {2}ORDER BY {0}",
                  table->number,
                  table->name,
                  condition));
  BindRig(*table, tx, &read);
  while (read.Next()) numbers.push_back(read.Int(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return numbers;
}

void PutTables(store::ReportedRecords* records) {
  for (const ReportedTable& table : ReportedTables()) {
    auto* to = records->add_tables();
    to->set_name(std::string(table.name));
    for (const ReportedColumn& column : table.columns) {
      to->add_columns(std::string(column.name));
    }
  }
}

absl::Status PutRecord(UnitOfWork* tx,
                       RecordKind kind,
                       std::int64_t number,
                       store::ReportedRecords* records) {
  auto* record = records->add_records();
  record->set_kind(static_cast<int>(kind));
  record->set_number(number);
  int index = 0;
  for (const ReportedTable& table : ReportedTables()) {
    if (table.kind == kind) {
      SELFCAL_RETURN_IF_ERROR(PutRows(tx, table, index, number, record));
    }
    ++index;
  }
  return absl::OkStatus();
}

const Value& ReportedRow::Of(std::string_view column) const {
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (table->columns[k].name == column && values[k] != nullptr) {
      return *values[k];
    }
  }
  return Value::default_instance();
}

absl::StatusOr<std::vector<ReportedRow>> CheckRows(
    const store::ReportedRecords& records,
    const store::ReportedRecords::Record& record) {
  std::vector<ReportedRow> rows;
  for (const auto& from : record.rows()) {
    if (from.table() < 0 || from.table() >= records.tables_size()) {
      return absl::InvalidArgumentError("a row of a report is of no table");
    }
    const auto& named = records.tables(from.table());
    const auto& all = ReportedTables();
    const auto table = std::find_if(
        all.begin(), all.end(), [&](const ReportedTable& candidate) {
          return candidate.name == named.name() &&
                 static_cast<int>(candidate.kind) == record.kind();
        });
    if (table == all.end()) return Unknown("the table " + named.name());
    if (named.columns_size() != from.values_size()) {
      return absl::InvalidArgumentError(
          fmt::format("a row of a report has {} values for {} columns",
                      from.values_size(),
                      named.columns_size()));
    }
    ReportedRow& row = rows.emplace_back();
    row.table = &*table;
    row.values.resize(table->columns.size());
    for (int k = 0; k < named.columns_size(); ++k) {
      const auto column = std::find_if(
          table->columns.begin(), table->columns.end(), [&](const auto& c) {
            return c.name == named.columns(k);
          });
      const std::string what =
          fmt::format("the column {}.{}", named.name(), named.columns(k));
      if (column == table->columns.end()) return Unknown(what);
      if (!HasType(from.values(k), column->type)) return Unknown(what);
      row.values[column - table->columns.begin()] = &from.values(k);
    }
    SELFCAL_RETURN_IF_ERROR(CheckBlobs(row));
  }
  return rows;
}

absl::Status WriteRow(UnitOfWork* tx,
                      const ReportedRow& row,
                      std::int64_t number,
                      OnConflict on_conflict) {
  const Written written = WrittenOf(row);
  std::vector<std::string> columns = {"rig"};
  if (!row.table->number.empty()) columns.emplace_back(row.table->number);
  columns.insert(columns.end(), written.columns.begin(), written.columns.end());
  std::vector<std::string> parameters;
  for (std::size_t k = 1; k <= columns.size(); ++k) {
    parameters.push_back(fmt::format("?{}", k));
  }
  Statement insert(
      tx->db(),
      fmt::format("INSERT INTO {} ({}) VALUES ({}) {}",
                  row.table->name,
                  fmt::join(columns, ", "),
                  fmt::join(parameters, ", "),
                  ConflictClause(row, written.columns, on_conflict)));
  BindRecord(*row.table, tx, number, &insert);
  for (const Value* value : written.values) BindValue(*value, &insert);
  return insert.Run();
}

absl::Status DeleteRows(UnitOfWork* tx,
                        const ReportedTable& table,
                        std::int64_t number) {
  Statement remove(
      tx->db(),
      fmt::format("DELETE FROM {} {}", table.name, WhereRecord(table)));
  BindRecord(table, tx, number, &remove);
  return remove.Run();
}

}  // namespace selfcal::server
