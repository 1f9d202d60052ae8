// The minimum interval between the runs of a rig.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/store.h"

namespace selfcal::server {

// Why the run, the newest of its rig and not started manually, does not begin
// at the steady time `now_ns`: the one before it ended too short a time ago, by
// the policy of the rig. Empty if it may begin.
absl::StatusOr<std::string> IntervalReason(Store* store,
                                           const StoredRun& run,
                                           std::int64_t now_ns);

}  // namespace selfcal::server
