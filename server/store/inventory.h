// The inventory in a report: which segments a rig has. Once all records were
// reported anew, the hub deletes the others, which the device has deleted while
// it did not report. Internal to the reports (outbox.h, report.h).
#pragma once

#include <absl/status/status.h>

#include "selfcal/store/report.pb.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Adds it to the records of a report.
absl::Status PutInventory(UnitOfWork* tx, store::ReportedRecords* records);
// Deletes the segments that are not in it. INVALID_ARGUMENT if it is none.
absl::Status ApplyInventory(UnitOfWork* tx,
                            const store::ReportedRecords::Record& record);

}  // namespace selfcal::server
