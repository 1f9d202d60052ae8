// The triggers by time, which may start a run of a rig that nothing was sent
// to: an old active calibration (RigPolicy::calibration_max_age_ns).
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

struct TimeCheck {
  std::optional<StoredRun> started;
  // The steady time from which on a trigger may start a run if no record of the
  // rig changes before; kNoCheck: none may; nullopt: none applies to the policy
  // of the rig.
  std::optional<std::int64_t> next;
};

// Creates the run that a trigger starts at the steady time `now_ns`, if there
// is one.
absl::StatusOr<TimeCheck> ApplyTimeTriggers(UnitOfWork* tx,
                                            const StoredRig& rig,
                                            std::int64_t now_ns);

}  // namespace selfcal::server
