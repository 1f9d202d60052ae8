// Which data of segments a device reports to its hub.
#pragma once

#include <absl/status/status.h>

#include <cstdint>

#include "server/domain/domain_options.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Has the data of a segment reported that was just stored, if all data is. To
// keep what waits for that within the quota, leaves out the data of the oldest
// segments, each with an event.
absl::Status ReportStoredData(UnitOfWork* tx,
                              std::int64_t sequence,
                              const Quotas& quotas);
// Has the data of a segment reported that was just scored, if it is still there
// and the data that is kept is reported.
absl::Status ReportKeptData(UnitOfWork* tx, std::int64_t sequence);

}  // namespace selfcal::server
