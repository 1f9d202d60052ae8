// Test of how well a candidate predicts the information of segments that it was
// not calibrated on. Pure functions.
#pragma once

#include <vector>

#include "core/change/consistency.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// Information of a segment, scored again at the candidate with its noise, or as
// it was scored on arrival.
struct HeldOutSegment {
  SegmentInformation information;
  bool rescored = false;
};
using HeldOutSegments = std::vector<HeldOutSegment>;

// Tests the combined information of the segments against the candidate and the
// active version, with the track noise of the candidate
// (core/change/consistency.h). Of three segments or more, the one without which
// the candidate fits best is left out: a single segment that does not fit
// proves nothing. Segments linearised too far from the candidate are left out
// and counted; for the active version, the same segments are used, however far
// they are linearised from it.
HeldOutTest TestHeldOut(const Rig& rig,
                        const KnownCalibration& candidate,
                        const KnownCalibration& active,
                        const HeldOutSegments& segments);

}  // namespace selfcal::server
