#include "server/store/absences.h"

#include "server/store/rigs.h"
#include "server/store/segment_rows.h"
#include "server/store/statement.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

// The numbers in kFits.
static_assert(static_cast<int>(AbsenceCause::kDoesNotFit) == 8 &&
              static_cast<int>(AbsenceCause::kManyOutliers) == 9);

absl::StatusOr<std::vector<TableAbsence>> ListAbsenceRows(
    Connection* db, const std::string& rig, const SegmentKey& key) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
  UnitOfWork tx(db, rig, rig_id, 0);
  SELFCAL_ASSIGN_OR_RETURN(const SegmentRow row, FindSegment(&tx, key));
  Statement read(db,
                 "SELECT a.group_name, a.cause, a.time_ns, r.session, "
                 "  r.session_index, a.rival_entropy, a.fit, a.fit_limit "
                 "FROM table_absences a "
                 "JOIN tables t ON t.rig = ?1 AND t.group_name = a.group_name "
                 "LEFT JOIN segments r ON r.segment = a.rival "
                 "WHERE a.segment = ?2 ORDER BY t.position",
                 rig_id,
                 row.rowid);
  std::vector<TableAbsence> absences;
  while (read.Next()) {
    TableAbsence absence;
    absence.group = read.Text(0);
    absence.cause = static_cast<AbsenceCause>(read.Int(1));
    absence.time_ns = read.Int(2);
    if (!read.IsNull(3)) absence.rival = {read.Text(3), read.Int(4)};
    if (!read.IsNull(5)) absence.rival_entropy = read.Double(5);
    if (!read.IsNull(6)) absence.fit = read.Double(6);
    if (!read.IsNull(7)) absence.fit_limit = read.Double(7);
    absences.push_back(std::move(absence));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return absences;
}

absl::Status WriteAbsence(UnitOfWork* tx,
                          std::int64_t segment,
                          const std::string& group,
                          const Absence& absence) {
  return Statement(tx->db(),
                   "INSERT OR REPLACE INTO table_absences (segment, "
                   "  group_name, cause, time_ns, rival, rival_entropy, fit, "
                   "  fit_limit) "
                   "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
                   segment,
                   group,
                   static_cast<int>(absence.cause),
                   tx->time_ns(),
                   absence.rival,
                   absence.rival_entropy,
                   absence.fit,
                   absence.fit_limit)
      .Run();
}

}  // namespace selfcal::server
