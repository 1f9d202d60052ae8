// The clocks that a calibration starts with, if those of its segments are far
// from it (core/information/offset_start.h).
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Moves segments whose states do not hold at their stamps and, if they are most
// of those that determine it, the clocks of theta by what they show: a few may
// be corrupt, or of a session with another clock. `moved` is empty, and
// afterwards holds those that replace elements of `segments`.
void StartAtOffsets(const Rig& rig,
                    Calibration* theta,
                    std::vector<const MotionSegment*>* segments,
                    std::vector<MotionSegment>* moved);

}  // namespace selfcal
