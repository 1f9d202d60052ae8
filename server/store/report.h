// Writes what a device reports to its hub (outbox.h): the hub then has the same
// records, but for the ends of segments. Nothing is computed of such a rig
// here.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

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

// Bytes that the records of a report take in memory once they are parsed.
std::int64_t ParsedSizeOfRecords(const std::string& records);

// The definition of a rig in a report that begins anew. INVALID_ARGUMENT if
// there is none.
absl::StatusOr<StoredRig> RigOfReport(const std::string& records,
                                      const std::string& rig);

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

// Whether there is room for the data of a segment of this size, compressed.
using AdmitData = std::function<absl::StatusOr<bool>(std::int64_t bytes)>;
// Writes the records (Report::records), so that they are as on the device; data
// without room is left out. INVALID_ARGUMENT for what is not a report that this
// program can read, FAILED_PRECONDITION for one that contradicts the records
// that are here. After an error the unit of work must not be committed.
absl::Status ApplyReport(UnitOfWork* tx,
                         const std::string& records,
                         const AdmitData& admit_data);

// --- Without a rig.

// The deletion of a rig by its device is remembered for longer than any report
// is on its way.
inline constexpr std::int64_t kEndOfReportsKept_ns =
    std::int64_t{7} * 24 * 3600 * 1'000'000'000;
// Store::EndReports. The newest attempt stays; what is older than
// kEndOfReportsKept_ns is removed.
absl::Status WriteEndOfReports(Connection* db,
                               std::int64_t key,
                               std::int64_t attempt,
                               std::int64_t now_ns);

}  // namespace selfcal::server
