#include "server/domain/exclusion.h"

#include <string>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/segment_rows.h"
#include "server/store/table_rows.h"

namespace selfcal::server {

absl::Status LeaveTables(UnitOfWork* tx,
                         std::int64_t segment,
                         const NewExclusion& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> groups,
                           TablesOfSegment(tx, segment));
  for (const std::string& group : groups) {
    SELFCAL_RETURN_IF_ERROR(WriteExclusion(tx, segment, group, reason));
    SELFCAL_RETURN_IF_ERROR(DeleteEntry(tx, group, segment));
  }
  return absl::OkStatus();
}

absl::Status LeaveTablesIf(
    UnitOfWork* tx,
    ExclusionCause cause,
    const std::function<bool(const TableEntry&)>& leaves) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables, ReadTables(tx));
  for (const Table& table : tables) {
    for (const TableEntry& entry : table.entries) {
      if (!leaves(entry)) continue;
      SELFCAL_RETURN_IF_ERROR(
          WriteExclusion(tx, entry.sequence, table.group, {.cause = cause}));
      SELFCAL_RETURN_IF_ERROR(DeleteEntry(tx, table.group, entry.sequence));
    }
  }
  return absl::OkStatus();
}

absl::Status RefuseTables(UnitOfWork* tx,
                          std::int64_t segment,
                          const NewExclusion& reason) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<Table> tables, ReadTables(tx));
  for (const Table& table : tables) {
    SELFCAL_RETURN_IF_ERROR(WriteExclusion(tx, segment, table.group, reason));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
