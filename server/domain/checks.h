// Checks of rigs by the rules about time: when a rig is looked at again, and
// what is done then. A rig that does not change is not read, so that the cost
// depends on how many rigs are in use and not on how many there are.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Requests the checks of the rig if the unit of work has changed a record.
absl::Status RequestChecksAfterChange(UnitOfWork* tx);

// Creates the run of the rig that a rule about time starts at the steady time
// `now_ns`, if there is one, and sets the next check.
absl::StatusOr<std::optional<StoredRun>> CheckTimes(UnitOfWork* tx,
                                                    std::int64_t now_ns);

// Creates the run of the rig at the end of its session (session_trigger.h), if
// no segment arrived after the steady time `idle_since_ns`, and sets the next
// check.
absl::StatusOr<std::optional<StoredRun>> CheckSession(
    UnitOfWork* tx, std::int64_t idle_since_ns);

}  // namespace selfcal::server
