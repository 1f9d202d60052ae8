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

// Whether there is room for the data of a segment of this size, compressed.
using AdmitData = std::function<absl::StatusOr<bool>(std::int64_t bytes)>;
// Writes the records (Report::records), so that they are as on the device; data
// without room is left out. INVALID_ARGUMENT for what is not a report that this
// program can read, FAILED_PRECONDITION for one that contradicts the records
// that are here. After an error the unit of work must not be committed.
absl::Status ApplyReport(UnitOfWork* tx,
                         const std::string& records,
                         const AdmitData& admit_data);

}  // namespace selfcal::server
