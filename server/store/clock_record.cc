#include "server/store/clock_record.h"

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {

absl::StatusOr<std::optional<ClockRecord>> ReadClockRecord(Connection* db) {
  Statement read(db,
                 "SELECT boot, since_boot_ns, time_ns, steady_ns, "
                 "  keep_until_ns FROM clock");
  std::optional<ClockRecord> clock;
  if (read.Next()) {
    clock = {.boot = read.Text(0),
             .since_boot_ns = read.Int(1),
             .time_ns = read.Int(2),
             .steady_ns = read.Int(3),
             .keep_until_ns = read.Int(4)};
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return clock;
}

absl::Status WriteClockRecord(Connection* db, const ClockRecord& clock) {
  return Statement(db,
                   "INSERT INTO clock (clock, boot, since_boot_ns, time_ns, "
                   "  steady_ns, keep_until_ns) VALUES (1, ?1, ?2, ?3, ?4, ?5) "
                   "ON CONFLICT (clock) DO UPDATE SET boot = ?1, "
                   "  since_boot_ns = ?2, time_ns = ?3, steady_ns = ?4, "
                   "  keep_until_ns = ?5",
                   clock.boot,
                   clock.since_boot_ns,
                   clock.time_ns,
                   clock.steady_ns,
                   clock.keep_until_ns)
      .Run();
}

}  // namespace selfcal::server
