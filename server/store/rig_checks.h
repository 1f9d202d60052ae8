// The times at which a rig is looked at next, by the rules about time and for
// its scores: a rig that has not changed, and for which no time has come, is
// not read. What a check does is decided elsewhere (server/domain).
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
  kScores,   // whether outdated scores were computed again, if it has any
};

// No check before the rig changes or, of its scores, before its run ends.
inline constexpr std::int64_t kNoCheck =
    std::numeric_limits<std::int64_t>::max();

// Store::ListRigsToCheck.
absl::StatusOr<std::vector<std::string>> RigsToCheck(Connection* db,
                                                     RigCheck check,
                                                     std::int64_t until_ns,
                                                     int limit);

// The steady time of the next check, as SetCheck has set it.
absl::StatusOr<std::optional<std::int64_t>> NextCheck(UnitOfWork* tx,
                                                      RigCheck check);

// Sets the steady time of the next check; nullopt: none before the policy
// changes (kTime), or scores become outdated (kScores).
absl::Status SetCheck(UnitOfWork* tx,
                      RigCheck check,
                      std::optional<std::int64_t> next_ns);

// Requests the checks by the rules about time after a change, unless they are
// due earlier: of the session at the steady time at which the newest segment
// arrived, of the rules about time at `time_ns`. Where the policy has none, it
// stays so.
absl::Status RequestChecks(UnitOfWork* tx, std::int64_t time_ns);

}  // namespace selfcal::server
