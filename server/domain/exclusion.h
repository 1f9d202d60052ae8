// Segments leave tables, and the reason is recorded (TableAbsence).
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>

#include "core/selection/tables.h"
#include "server/store/absences.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Takes a segment out of all tables that hold it.
absl::Status LeaveTables(UnitOfWork* tx,
                         std::int64_t segment,
                         const Absence& reason);

// Takes the entries out of their tables for which `leaves` is true.
absl::Status LeaveTablesIf(
    UnitOfWork* tx,
    AbsenceCause cause,
    const std::function<bool(const TableEntry&)>& leaves);

// Records for every table that it was not offered the segment.
absl::Status RefuseTables(UnitOfWork* tx,
                          std::int64_t segment,
                          const Absence& reason);

}  // namespace selfcal::server
