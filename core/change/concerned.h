// Components of theta that a device change concerns, by the names of its
// groups. Pure, callable from any thread.
#pragma once

#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// Components of these groups, ascending. A component that is in one of them is
// concerned, even if it is also in other groups.
std::vector<int> ConcernedComponents(const Rig& rig,
                                     const std::vector<std::string>& groups);

// All other components that the rig estimates, ascending: earlier knowledge
// about them remains valid after the change.
std::vector<int> UnconcernedComponents(const Rig& rig,
                                       const std::vector<std::string>& groups);

}  // namespace selfcal
