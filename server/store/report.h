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

// Bytes that the records of a report take in memory once they are parsed.
std::int64_t ParsedSizeOfRecords(const std::string& records);

// The definition of a rig in a report that begins anew. INVALID_ARGUMENT if
// there is none.
absl::StatusOr<StoredRig> RigOfReport(const std::string& records,
                                      const std::string& rig);

// What the domain decides while a report is written.
struct ReportRules {
  // Whether there is room for the data of a segment of this size, compressed.
  std::function<absl::StatusOr<bool>(std::int64_t bytes)> admit_data;
  // The state of the active version once another one has replaced it.
  CalibrationState (*replaced)(std::int64_t active, std::int64_t version);
};
// Writes the records (Report::records), so that they are as on the device; data
// without room is left out. INVALID_ARGUMENT for what is not a report that this
// program can read, FAILED_PRECONDITION for one that contradicts the records
// that are here. After an error the unit of work must not be committed.
absl::Status ApplyReport(UnitOfWork* tx,
                         const std::string& records,
                         const ReportRules& rules);

}  // namespace selfcal::server
