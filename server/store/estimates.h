// Records of the parameters of versions, one for each component of theta: what
// the content of a version has, in a form that SQL can search.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

class Connection;  // driver/driver.h

// Writes those of a version that is stored, in place of what there was. Values
// that are not numbers are left out.
absl::Status InsertEstimates(UnitOfWork* tx,
                             const StoredCalibration& calibration);

// Store::ListEstimates.
absl::StatusOr<Listed<StoredEstimate>> ListEstimateRows(
    Connection* db, const EstimateQuery& query, const Page& page);
// Store::ListWithoutEstimates.
absl::StatusOr<std::vector<VersionId>> VersionsWithoutEstimates(Connection* db,
                                                                int limit);

}  // namespace selfcal::server
