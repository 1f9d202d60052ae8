// Reads a whole database and tells what is wrong with it.
#pragma once

#include <absl/status/statusor.h>

#include "server/store/maintenance.h"
#include "server/store/statement.h"

namespace selfcal::server {

// CANCELLED if `on_problem` said so.
absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem);

}  // namespace selfcal::server
