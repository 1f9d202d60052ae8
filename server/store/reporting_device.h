// Which device reports a rig to this hub, and what is remembered of rigs that
// their devices have deleted.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>

#include "core/model/calibration.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The device that reports a rig.
struct ReportingDevice {
  std::int64_t key = 0;     // of the rig in the database of the device
  std::int64_t report = 0;  // number of the last that was taken
  // The newest attempt that was taken; 0: the device does not count them.
  std::int64_t attempt = 0;
  std::int64_t time_ns = 0;
  std::int64_t waiting = 0;  // records that were still to be reported then
  std::string program_version;
};

// --- Within a unit of work.

// nullopt if no device reports the rig.
absl::StatusOr<std::optional<ReportingDevice>> ReadReportingDevice(
    UnitOfWork* tx);
absl::Status WriteReportingDevice(UnitOfWork* tx,
                                  const ReportingDevice& device);

// The factory calibration of a rig that a device reports; nullopt for others.
absl::StatusOr<std::optional<Calibration>> FactoryIfReported(
    Connection* db, const std::string& rig);

// The attempt that told of the deletion of the rig with this key in the
// database of a device (Store::EndReports); 0: none. Until the unit of work is
// committed, none can.
absl::StatusOr<std::int64_t> ReadEndOfReports(UnitOfWork* tx, std::int64_t key);
// It is reported again, by a device that was restored from a backup.
absl::Status ForgetEndOfReports(UnitOfWork* tx, std::int64_t key);

// --- Without a rig.

// Store::EndReports. The newest attempt stays.
absl::Status WriteEndOfReports(Connection* db,
                               std::int64_t key,
                               std::int64_t attempt,
                               std::int64_t now_ns,
                               std::int64_t kept_ns);

// Store::CountReported.
absl::StatusOr<Store::ReportedCount> CountReportedRows(
    Connection* db, std::int64_t silent_before_ns);

}  // namespace selfcal::server
