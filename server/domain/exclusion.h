// Removal of segments from tables; the reason is recorded as an exclusion
// (TableAbsence).
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>

#include "core/selection/tables.h"
#include "server/store/absences.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Removes a segment from all tables that hold it.
absl::Status LeaveTables(UnitOfWork* tx,
                         std::int64_t segment,
                         const Absence& reason);

// Removes the entries for which `leaves` is true from their tables.
absl::Status LeaveTablesIf(
    UnitOfWork* tx,
    AbsenceCause cause,
    const std::function<bool(const TableEntry&)>& leaves);

// Records, for every table, why the segment was not offered to it.
absl::Status RefuseTables(UnitOfWork* tx,
                          std::int64_t segment,
                          const Absence& reason);

}  // namespace selfcal::server
