// When the rules about time look at a rig next: a rig that has not changed, and
// for which no time has come, is not read. What a check does is decided
// elsewhere (server/domain).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "server/store/unit_of_work.h"

namespace selfcal::server {

enum class RigCheck {
  kSession,  // whether a session has ended
  kTime,     // the rules about time of the policy of the rig, if it has any
};

// No check before the rig changes.
inline constexpr std::int64_t kNoCheck =
    std::numeric_limits<std::int64_t>::max();

// Store::ListRigsToCheck.
absl::StatusOr<std::vector<std::string>> RigsToCheck(Connection* db,
                                                     RigCheck check,
                                                     std::int64_t until_ns,
                                                     int limit);

// Sets the steady time of the next check; nullopt, for kTime only: none before
// the policy changes.
absl::Status SetCheck(UnitOfWork* tx,
                      RigCheck check,
                      std::optional<std::int64_t> next_ns);

// Requests both checks after a change, unless they are due earlier: of the
// session at the steady time at which the newest segment arrived, of the rules
// about time at `time_ns`. Where the policy has none, it stays so.
absl::Status RequestChecks(UnitOfWork* tx, std::int64_t time_ns);

}  // namespace selfcal::server
