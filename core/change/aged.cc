#include "core/change/aged.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/model/too_many.h"

namespace selfcal {

Eigen::VectorXd WalkDensities(const Rig& rig,
                              const std::vector<WalkDensity>& walks) {
  constexpr double kDefaultInReferenceSigmas = 0.01;
  const auto components = TangentComponents(rig.factory);
  Eigen::VectorXd densities = kDefaultInReferenceSigmas * ReferenceSigmas(rig);
  for (const WalkDensity& walk : walks) {
    for (const int i : MatchComponents(components, {walk.pattern})) {
      densities[i] = walk.density;
    }
  }
  return densities;
}

std::vector<Violation> Validate(const Rig& rig,
                                const std::vector<WalkDensity>& walks) {
  // Keeps squares finite, whatever the age.
  constexpr double kMostDensity = 1e6;
  if (walks.size() > kMaxPatterns) {
    return {{"walk_densities", TooMany(walks.size(), kMaxPatterns)}};
  }
  const auto components = TangentComponents(rig.factory);
  std::vector<Violation> violations;
  for (std::size_t i = 0; i < walks.size(); ++i) {
    const std::string path = "walk_densities[" + std::to_string(i) + "]";
    if (MatchComponents(components, {walks[i].pattern}).empty()) {
      violations.push_back({path + ".pattern",
                            "'" + walks[i].pattern +
                                "' matches no component; use a name such "
                                "as '" +
                                components.front().name +
                                "', or '*' at its begin or end"});
    }
    if (!(walks[i].density >= 0 && walks[i].density <= kMostDensity)) {
      violations.push_back({path + ".value", "is not in [0, 1e6]"});
    }
  }
  return violations;
}

Eigen::MatrixXd AgedCovariance(const Rig& rig,
                               const Eigen::VectorXd& densities,
                               const Eigen::MatrixXd& covariance,
                               double days) {
  Eigen::MatrixXd aged = covariance;
  for (const int i : FreeComponents(rig)) {
    aged(i, i) += densities(i) * densities(i) * std::max(0.0, days);
  }
  return aged;
}

}  // namespace selfcal
