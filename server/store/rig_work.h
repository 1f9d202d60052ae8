// How much work there is, and which rigs have some: segments to score and runs
// to execute.
#pragma once

#include <absl/status/statusor.h>

#include <set>
#include <string>

#include "server/store/store.h"

namespace selfcal::server {

// Store::CountWork.
absl::StatusOr<Store::WorkCount> CountWorkRows(Connection* db);
// Store::FindBusyRigs.
absl::StatusOr<std::set<std::string>> BusyRigs(
    Connection* db, const std::set<std::string>& rigs);

}  // namespace selfcal::server
