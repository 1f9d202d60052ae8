// A rig in the list of activities, as the message of the contract.
#pragma once

#include <cstdint>

#include "selfcal/v1/activity_service.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

// What the store keeps, with alarms; without traffic and the current run.
// `now_ns` is the time, since the Unix epoch.
v1::RigActivity Encode(const RigSummary& rig, std::int64_t now_ns);

}  // namespace selfcal::server
