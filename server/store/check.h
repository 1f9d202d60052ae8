// Verifies a whole database.
#pragma once

#include <absl/status/statusor.h>

#include "server/store/driver/driver.h"
#include "server/store/maintenance.h"

namespace selfcal::server {

// CANCELLED if `on_problem` returned false.
absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem);

}  // namespace selfcal::server
