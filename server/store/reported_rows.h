// The rows of a record in a report (reported_tables.h): read on the device,
// written at the hub. Internal to the reports (outbox.h, report.h).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string_view>
#include <vector>

#include "selfcal/store/report.pb.h"
#include "server/store/record_kind.h"
#include "server/store/reported_tables.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The numbers of the records of a kind, in their order; 0 for a kind of which
// a rig has one. Of events those of this rig, without any of an earlier one of
// its name.
absl::StatusOr<std::vector<std::int64_t>> NumbersOf(UnitOfWork* tx,
                                                    RecordKind kind);

// Lists the tables in the message, in this order.
void PutTables(store::ReportedRecords* records);
// Adds the rows of a record, none if it is gone. Damaged data and information
// of segments are left out.
absl::Status PutRecord(UnitOfWork* tx,
                       RecordKind kind,
                       std::int64_t number,
                       store::ReportedRecords* records);

// A row that was reported, checked against the table: its columns exist, its
// values have their types, and a blob matches its checksum.
struct ReportedRow {
  const ReportedTable* table;
  // In the order of the table's columns; null where the device does not have
  // the column.
  std::vector<const store::ReportedRecords::Value*> values;

  const store::ReportedRecords::Value& Of(std::string_view column) const;
};
// INVALID_ARGUMENT for what this program does not know.
absl::StatusOr<std::vector<ReportedRow>> CheckRows(
    const store::ReportedRecords& records,
    const store::ReportedRecords::Record& record);

enum class OnConflict { kUpdate, kKeep };
absl::Status WriteRow(UnitOfWork* tx,
                      const ReportedRow& row,
                      std::int64_t number,
                      OnConflict on_conflict);
// Deletes the rows of a record from a table.
absl::Status DeleteRows(UnitOfWork* tx,
                        const ReportedTable& table,
                        std::int64_t number);

}  // namespace selfcal::server
