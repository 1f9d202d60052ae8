// Writes the versions of a rig that a device reports, and what became of them.
// Internal to report.h.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <vector>

#include "server/store/report_application.h"

namespace selfcal::server {

absl::Status ApplyCalibration(ReportApplication* to,
                              std::int64_t version,
                              const std::vector<ReportedRow>& rows);

absl::Status ApplyActivation(ReportApplication* to,
                             std::int64_t activation,
                             const std::vector<ReportedRow>& rows);

}  // namespace selfcal::server
