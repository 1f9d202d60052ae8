#include "server/store/report_application.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/status/status_macros.h"
#include "server/store/rigs.h"

namespace selfcal::server {

absl::Status ReadFactory(ReportApplication* to) {
  if (to->factory) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored, ReadRig(to->tx));
  to->factory = stored.rig.factory;
  return absl::OkStatus();
}

absl::Status BadReport(const std::string& why) {
  return absl::InvalidArgumentError("the report cannot be read: " + why);
}

absl::Status Contradiction(const std::string& what) {
  return absl::FailedPreconditionError(
      fmt::format("the report contradicts the records of the hub: {}", what));
}

absl::Status About(const std::string& what, const absl::Status& checked) {
  if (checked.ok()) return checked;
  return BadReport(fmt::format("{}: {}", what, std::string(checked.message())));
}

const ReportedRow* RowOf(const std::vector<ReportedRow>& rows,
                         std::string_view table) {
  const auto found =
      std::find_if(rows.begin(), rows.end(), [&](const ReportedRow& row) {
        return row.table->name == table;
      });
  return found == rows.end() ? nullptr : &*found;
}

}  // namespace selfcal::server
