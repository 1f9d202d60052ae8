// A scored segment as the joint choice sees it: all that it says about theta,
// and which landmarks it stands on. Values; pure functions.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct Candidate {
  SegmentKey key;
  std::int64_t sequence = 0;  // order of arrival; ties go to the older
  // Of the free components, in units of the prior's sigmas: the identity says
  // as much as the prior.
  Eigen::MatrixXd information;
  LandmarkSketch landmarks;
};

Candidate MakeCandidate(const Rig& rig,
                        const SegmentKey& key,
                        std::int64_t sequence,
                        const SegmentInformation& information);

}  // namespace selfcal
