// The trigger by age: an old active calibration may start a run.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Creates a run if the active calibration is the result of a run and has been
// active for longer than the policy of the rig allows, the tables hold a
// segment that the last run was not created with, no run is unfinished, and the
// last one was created as long ago, at the steady time `now_ns`.
absl::StatusOr<std::optional<StoredRun>> CreateAgedRun(UnitOfWork* tx,
                                                       const StoredRig& rig,
                                                       std::int64_t now_ns);

}  // namespace selfcal::server
