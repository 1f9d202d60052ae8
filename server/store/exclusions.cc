#include "server/store/exclusions.h"

#include <fmt/format.h>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {

std::string ExcludedFor(std::string_view parameter) {
  return fmt::format(
      "EXISTS (SELECT 1 FROM table_absences a "
      "  WHERE a.rig = s.rig AND a.sequence = s.sequence "
      "  AND ((CAST({} AS BIGINT) >> CAST(a.cause AS INTEGER)) & 1) = 1)",
      parameter);
}

absl::StatusOr<std::vector<Exclusion>> ListExclusionRows(
    Connection* db, const std::string& rig, const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  UnitOfWork tx(db, rig, rig_id, 0);
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row, FindSegment(&tx, key));
  Statement read(db,
                 "SELECT a.group_name, a.cause, a.time_ns, r.session, "
                 "  r.session_index, a.rival_entropy, a.fit, a.fit_limit "
                 "FROM table_absences a "
                 "JOIN tables t ON t.rig = a.rig "
                 "  AND t.group_name = a.group_name "
                 "LEFT JOIN segments r ON r.rig = a.rig "
                 "  AND r.sequence = a.rival "
                 "WHERE a.rig = ?1 AND a.sequence = ?2 ORDER BY t.position",
                 rig_id,
                 row.sequence);
  std::vector<Exclusion> exclusions;
  while (read.Next()) {
    Exclusion exclusion;
    exclusion.group = read.Text(0);
    exclusion.cause = static_cast<ExclusionCause>(read.Int(1));
    exclusion.time_ns = read.Int(2);
    if (!read.IsNull(3)) exclusion.rival = {read.Text(3), read.Int(4)};
    if (!read.IsNull(5)) exclusion.rival_entropy = read.Double(5);
    if (!read.IsNull(6)) exclusion.fit = read.Double(6);
    if (!read.IsNull(7)) exclusion.fit_limit = read.Double(7);
    exclusions.push_back(std::move(exclusion));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return exclusions;
}

absl::Status WriteExclusion(UnitOfWork* tx,
                            std::int64_t sequence,
                            const std::string& group,
                            const NewExclusion& exclusion) {
  tx->Changed(RecordKind::kSegment, sequence);
  return Statement(tx->db(),
                   "INSERT INTO table_absences (rig, sequence, group_name, "
                   "  cause, time_ns, rival, rival_entropy, fit, fit_limit) "
                   "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) "
                   "ON CONFLICT (rig, sequence, group_name) DO UPDATE SET "
                   "  cause = excluded.cause, time_ns = excluded.time_ns, "
                   "  rival = excluded.rival, "
                   "  rival_entropy = excluded.rival_entropy, "
                   "  fit = excluded.fit, fit_limit = excluded.fit_limit",
                   tx->rig_row(),
                   sequence,
                   group,
                   static_cast<int>(exclusion.cause),
                   tx->time_ns(),
                   exclusion.rival,
                   exclusion.rival_entropy,
                   exclusion.fit,
                   exclusion.fit_limit)
      .Run();
}

}  // namespace selfcal::server
