// What is kept, and for how long: segments in tables by their age, data by who
// needs it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "core/selection/tables.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The tables, after segments have left them that are too old at that time by
// the policy of the rig.
absl::StatusOr<std::vector<Table>> RemoveAgedEntries(UnitOfWork* tx,
                                                     const StoredRig& rig,
                                                     std::int64_t now_ns);

// Deletes the data of each segment that neither waits for its score nor is in a
// table or an unfinished run, nor is part of the reserve. Segments from before
// the newest device change and misfits are never part of it.
absl::Status DropUnneededData(UnitOfWork* tx);

}  // namespace selfcal::server
