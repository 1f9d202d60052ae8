// What of a rig can change once it exists.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Makes the new definition of a rig out of the present one, or says why not.
using RigChange = std::function<absl::StatusOr<StoredRig>(const StoredRig&)>;

struct RigUpdate {
  StoredRig rig;
  // True if the scores of stored segments follow another prior now: they are
  // noted as outdated (outdated_scores.h).
  bool rescore = false;
};

// Applies the change. INVALID_ARGUMENT if it changes what the device is, or
// what stored information was computed with: only the labels, the prior (its
// mean and sigmas), the thresholds of tables and triggers, the policy and the
// use of noise scales can change. Stored information does not contain the
// prior; scores depend on its sigmas. An event names the caller and the reason,
// if there is one.
absl::StatusOr<RigUpdate> UpdateRig(UnitOfWork* tx,
                                    const RigChange& change,
                                    const std::string& caller,
                                    const std::string& reason);

}  // namespace selfcal::server
