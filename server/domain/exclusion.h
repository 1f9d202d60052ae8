// Removal of segments from tables, and refusal of those that are not offered;
// the reason is recorded as an exclusion.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>

#include "core/selection/tables.h"
#include "server/store/exclusions.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// What makes a segment a misfit: its residuals. A misfit is evidence of
// nothing: it is not remembered, does not validate a candidate, is not in the
// reserve, and does not indicate a device change.
inline constexpr ExclusionCauses kMisfit = {ExclusionCause::kDoesNotFit,
                                            ExclusionCause::kManyOutliers};

// Removes a segment from all tables that hold it.
absl::Status LeaveTables(UnitOfWork* tx,
                         std::int64_t segment,
                         const NewExclusion& reason);

// Removes the entries for which `leaves` is true from their tables.
absl::Status LeaveTablesIf(
    UnitOfWork* tx,
    ExclusionCause cause,
    const std::function<bool(const TableEntry&)>& leaves);

// Records, for every table, why the segment was not offered to it.
absl::Status RefuseTables(UnitOfWork* tx,
                          std::int64_t segment,
                          const NewExclusion& reason);

}  // namespace selfcal::server
