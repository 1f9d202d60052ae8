#include "server/store/reporting_device.h"

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

// Returns the newest attempt.
absl::StatusOr<std::int64_t> PutEndOfReports(Connection* db,
                                             std::int64_t key,
                                             std::int64_t attempt,
                                             std::int64_t now_ns) {
  return InsertReturning(
      db,
      "INSERT INTO ended_reports AS e (device, attempt, time_ns) "
      "VALUES (?1, ?2, ?3) ON CONFLICT (device) DO UPDATE SET "
      "  attempt = CASE WHEN e.attempt < ?2 THEN ?2 ELSE e.attempt END, "
      "  time_ns = ?3 "
      "RETURNING attempt",
      key,
      attempt,
      now_ns);
}

}  // namespace

absl::StatusOr<std::optional<ReportingDevice>> ReadReportingDevice(
    UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT device, report, attempt, time_ns, waiting, "
                 "  program_version "
                 "FROM reported_rigs WHERE rig = ?1",
                 tx->rig_row());
  std::optional<ReportingDevice> device;
  if (read.Next()) {
    device = {read.Int(0),
              read.Int(1),
              read.Int(2),
              read.Int(3),
              read.Int(4),
              read.Text(5)};
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return device;
}

absl::StatusOr<std::optional<Calibration>> FactoryIfReported(
    Connection* db, const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_row, FindRigId(db, rig));
  UnitOfWork tx(db, rig, rig_row, 0);
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(&tx));
  if (!device) return std::nullopt;
  SELFCAL_ASSIGN_OR_RETURN(StoredRig stored, ReadRig(&tx));
  return std::move(stored.rig.factory);
}

absl::Status WriteReportingDevice(UnitOfWork* tx,
                                  const ReportingDevice& device) {
  return Statement(
             tx->db(),
             "INSERT INTO reported_rigs (rig, device, report, attempt, "
             "  time_ns, waiting, program_version) "
             "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7) "
             "ON CONFLICT (rig) DO UPDATE SET device = ?2, report = ?3, "
             "  attempt = ?4, time_ns = ?5, waiting = ?6, program_version = ?7",
             tx->rig_row(),
             device.key,
             device.report,
             device.attempt,
             device.time_ns,
             device.waiting,
             device.program_version)
      .Run();
}

absl::StatusOr<std::int64_t> ReadEndOfReports(UnitOfWork* tx,
                                              std::int64_t key) {
  // Writes, so that a concurrent report of the deletion waits for this unit of
  // work.
  return PutEndOfReports(tx->db(), key, 0, tx->time_ns());
}

absl::Status ForgetEndOfReports(UnitOfWork* tx, std::int64_t key) {
  return Statement(tx->db(), "DELETE FROM ended_reports WHERE device = ?1", key)
      .Run();
}

absl::Status WriteEndOfReports(Connection* db,
                               std::int64_t key,
                               std::int64_t attempt,
                               std::int64_t now_ns,
                               std::int64_t kept_ns) {
  SELFCAL_RETURN_IF_ERROR(Statement(db,
                                    "DELETE FROM ended_reports "
                                    "WHERE time_ns < ?1",
                                    now_ns - kept_ns)
                              .Run());
  return PutEndOfReports(db, key, attempt, now_ns).status();
}

absl::StatusOr<Store::ReportedCount> CountReportedRows(
    Connection* db, std::int64_t silent_before_ns) {
  // Without the cast, a sum of PostgreSQL is a decimal.
  Statement read(db,
                 "SELECT count(*), count(*) FILTER (WHERE time_ns < ?1), "
                 "  CAST(sum(waiting) AS BIGINT), min(time_ns), max(time_ns) "
                 "FROM reported_rigs",
                 silent_before_ns);
  Store::ReportedCount count;
  if (read.Next()) {
    count = {read.Int(0), read.Int(1), read.Int(2), read.Int(3), read.Int(4)};
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return count;
}

}  // namespace selfcal::server
