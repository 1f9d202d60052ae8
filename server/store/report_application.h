// What the writing of all kinds of records of a report shares. Internal to
// report.h.
#pragma once

#include <absl/status/status.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/calibration.h"
#include "server/store/report.h"
#include "server/store/reported_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The writing of the records of one report.
struct ReportApplication {
  UnitOfWork* tx;
  const ReportRules& rules;
  // The factory calibration, once it was read.
  std::optional<Calibration> factory = std::nullopt;
};

absl::Status ReadFactory(ReportApplication* to);

// INVALID_ARGUMENT.
absl::Status BadReport(const std::string& why);
// FAILED_PRECONDITION.
absl::Status Contradiction(const std::string& what);
// Names what was reported in an error of report_check.h.
absl::Status About(const std::string& what, const absl::Status& checked);

// The row of a table that has one for each record; null if it is not there.
const ReportedRow* RowOf(const std::vector<ReportedRow>& rows,
                         std::string_view table);

}  // namespace selfcal::server
