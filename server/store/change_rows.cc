#include "server/store/change_rows.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/driver/statement.h"
#include "server/store/rigs.h"

namespace selfcal::server {

absl::StatusOr<StoredChange> ReadChange(Connection* db,
                                        const std::string& rig,
                                        std::int64_t number) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  Statement read(db,
                 "SELECT time_ns, kind, first_sequence, base_version, "
                 "  inflation FROM changes WHERE rig = ?1 AND change = ?2",
                 rig_id,
                 number);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return absl::NotFoundError(
        fmt::format("rig {} has no change {}", rig, number));
  }
  StoredChange change;
  change.rig = rig;
  change.change = number;
  change.time_ns = read.Int(0);
  change.kind = static_cast<ChangeKind>(read.Int(1));
  change.first_sequence = read.Int(2);
  change.base_version = read.Int(3);
  change.inflation = read.Double(4);
  Statement groups(db,
                   "SELECT c.group_name FROM change_groups c "
                   "JOIN tables t ON t.rig = c.rig "
                   "  AND t.group_name = c.group_name "
                   "WHERE c.rig = ?1 AND c.change = ?2 ORDER BY t.position",
                   rig_id,
                   number);
  while (groups.Next()) {
    change.groups.push_back(groups.Text(0));
  }
  SELFCAL_RETURN_IF_ERROR(groups.status());
  return change;
}

absl::StatusOr<std::int64_t> NewestChange(UnitOfWork* tx) {
  return ReadInt(tx->db(),
                 "SELECT coalesce(max(change), 0) FROM changes WHERE rig = ?1",
                 tx->rig_row());
}

absl::StatusOr<StoredChange> ReadChange(UnitOfWork* tx, std::int64_t change) {
  return ReadChange(tx->db(), tx->rig(), change);
}

absl::Status InsertChange(UnitOfWork* tx, const StoredChange& change) {
  tx->Changed(RecordKind::kChange, change.change);
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO changes (rig, change, time_ns, kind, "
                "  first_sequence, base_version, inflation) "
                "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                tx->rig_row(),
                change.change,
                change.time_ns,
                static_cast<int>(change.kind),
                change.first_sequence,
                change.base_version,
                change.inflation)
          .Run());
  for (const std::string& group : change.groups) {
    SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                      "INSERT INTO change_groups "
                                      "(rig, change, group_name) "
                                      "VALUES (?1, ?2, ?3)",
                                      tx->rig_row(),
                                      change.change,
                                      group)
                                .Run());
  }
  return AnnounceCalibration(tx);  // its verdict may be another now
}

}  // namespace selfcal::server
