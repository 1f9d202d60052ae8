// Records of the statistics of cohorts.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

class Connection;  // driver/driver.h

// Store::ListCohorts.
absl::StatusOr<Listed<StoredCohort>> ListCohortRows(Connection* db,
                                                    const std::string& label,
                                                    const std::string& value,
                                                    const Page& page);
// Store::ListLabelValues.
absl::StatusOr<std::vector<std::string>> LabelValues(Connection* db,
                                                     const std::string& label);

// Store::ListOutliers.
absl::StatusOr<std::map<std::string, std::int64_t>> Outliers(Connection* db);

// Store::PutCohort, within a transaction.
absl::StatusOr<std::int64_t> InsertCohort(Connection* db,
                                          const StoredCohort& cohort,
                                          std::int64_t kept);

// --- Within a unit of work.

// Notes the version of the rig that contradicts its cohort; 0: none does.
absl::Status WriteOutlier(UnitOfWork* tx, std::int64_t version);

}  // namespace selfcal::server
