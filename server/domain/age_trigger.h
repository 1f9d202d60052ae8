// The trigger by age: an old active calibration may start a run.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The steady time from which on the rule may start a run if no record of the
// rig changes before; kNoCheck: it may not. The active calibration must be the
// result of a run and have been active for as long as the policy of the rig
// allows, no run may be unfinished, and the last one must have been created as
// long ago.
absl::StatusOr<std::int64_t> AgedRunDue(UnitOfWork* tx, const StoredRig& rig);

// Creates a run if one is due at the steady time `now_ns` and the tables hold a
// segment that the last run was not created with.
absl::StatusOr<std::optional<StoredRun>> CreateAgedRun(UnitOfWork* tx,
                                                       const StoredRig& rig,
                                                       std::int64_t now_ns);

}  // namespace selfcal::server
