// Conversion of the policy of a rig to and from the fields of its message.
#pragma once

#include <vector>

#include "core/model/segment.h"
#include "selfcal/v1/rig.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

void PutPolicy(const RigPolicy& policy, v1::Rig* message);

// Fills *policy, or returns every violation: durations are between 0 (disabled)
// and a hundred years. Walk densities are validated by Validate of
// core/change/aged.h, which needs the rig.
std::vector<Violation> GetPolicy(const v1::Rig& message, RigPolicy* policy);

}  // namespace selfcal::server
