#include "core/selection/candidate.h"

#include <vector>

namespace selfcal {

Candidate MakeCandidate(const Rig& rig,
                        const SegmentKey& key,
                        std::int64_t sequence,
                        const SegmentInformation& information) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd scale = PriorSigmas(rig)(free);
  return {
      key,
      sequence,
      scale.asDiagonal() * information.Lambda(free, free) * scale.asDiagonal(),
      information.landmarks};
}

}  // namespace selfcal
