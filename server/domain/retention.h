// Retention: how long segments stay in tables, and whose data is kept.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "core/selection/tables.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Removes segments from the tables that are too old at the steady time `now_ns`
// by the policy of the rig, unless Moment::keeps_aged, and returns the tables.
absl::StatusOr<std::vector<Table>> RemoveAgedEntries(UnitOfWork* tx,
                                                     const StoredRig& rig,
                                                     std::int64_t now_ns);

// Deletes the data of each segment that is not waiting for its score or for its
// report to the hub, and is in no table, no unfinished run and not in the
// reserve. Segments from before the
// newest device change and misfits are never in the reserve.
absl::Status DropUnneededData(UnitOfWork* tx);

}  // namespace selfcal::server
