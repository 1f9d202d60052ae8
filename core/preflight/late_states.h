// By how much later than their stamps the states of segments hold.
//
// The states of a SLAM system that knows the time offsets of its cameras hold
// at their stamps, and the exposures are later by the offsets. Those of one
// that worked with an older version, without the offsets, are those at the
// exposures: they hold later, and the offsets are in them already. Internal to
// core/preflight.
#pragma once

#include <span>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// The time of each segment, which need not be valid; zero if no camera of theta
// has a time offset, a drift or a line delay. The gyroscope shows it
// (time_offset.h). Where it shows that the states are late, or shows nothing,
// as in a steady turn, they are taken to be so if that predicts the pixels
// better.
std::vector<double> FindLateStates(const Rig& rig,
                                   const Calibration& theta,
                                   std::span<const MotionSegment> segments);

}  // namespace selfcal
