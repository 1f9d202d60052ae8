// A scored segment as the joint selection uses it: its information about theta,
// and the landmarks on which that is based. Values; pure functions.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct Candidate {
  SegmentKey key;
  std::int64_t sequence = 0;  // order of arrival; the older wins ties
  // Information of the free components, in units of the prior's sigmas: the
  // identity is as much as the prior.
  Eigen::MatrixXd information;
  LandmarkSketch landmarks;
};

Candidate MakeCandidate(const Rig& rig,
                        const SegmentKey& key,
                        std::int64_t sequence,
                        const SegmentInformation& information);

}  // namespace selfcal
