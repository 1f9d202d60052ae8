// Which components of theta a change concerns, by the names of its groups.
// Pure, any thread.
#pragma once

#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

// Of the groups of these names, ascending. A component that is in one of them
// is concerned, whatever other groups it is in.
std::vector<int> ConcernedComponents(const Rig& rig,
                                     const std::vector<std::string>& groups);

// All others that the rig estimates, ascending: what was known of them before
// the change holds after it.
std::vector<int> UnconcernedComponents(const Rig& rig,
                                       const std::vector<std::string>& groups);

}  // namespace selfcal
