// SQL that leaves out the rigs that devices report to this hub: what follows
// from their segments is computed by the device.
#pragma once

#include <string>

namespace selfcal::server {

// A condition on `rig`, a key of a rig such as "r.rig".
inline std::string IsOwnRig(const std::string& rig) {
  return "NOT EXISTS (SELECT 1 FROM reported_rigs p WHERE p.rig = " + rig + ")";
}

}  // namespace selfcal::server
