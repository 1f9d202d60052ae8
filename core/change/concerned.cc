#include "core/change/concerned.h"

#include <algorithm>
#include <iterator>
#include <set>

namespace selfcal {

std::vector<int> ConcernedComponents(const Rig& rig,
                                     const std::vector<std::string>& groups) {
  std::set<int> concerned;
  for (const ParameterGroup& group : rig.groups) {
    if (std::find(groups.begin(), groups.end(), group.name) == groups.end()) {
      continue;
    }
    const std::vector<int> components = GroupComponents(rig, group);
    concerned.insert(components.begin(), components.end());
  }
  return {concerned.begin(), concerned.end()};
}

std::vector<int> UnconcernedComponents(const Rig& rig,
                                       const std::vector<std::string>& groups) {
  const std::vector<int> free = FreeComponents(rig);
  const std::vector<int> concerned = ConcernedComponents(rig, groups);
  std::vector<int> unconcerned;
  std::set_difference(free.begin(),
                      free.end(),
                      concerned.begin(),
                      concerned.end(),
                      std::back_inserter(unconcerned));
  return unconcerned;
}

}  // namespace selfcal
