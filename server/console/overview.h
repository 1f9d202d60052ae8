// A rig in the list of rigs, with alarms for the operator.
#pragma once

#include "server/console/overview.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

console::RigOverview Encode(const RigSummary& rig);

}  // namespace selfcal::server
