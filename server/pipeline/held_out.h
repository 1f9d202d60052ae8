// How well a candidate predicts what segments show that it was not calibrated
// on. Pure.
#pragma once

#include <vector>

#include "core/change/consistency.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// What a segment shows, scored again at the candidate with the noise that it
// found, or as it was scored when it came.
struct HeldOutSegment {
  SegmentInformation information;
  bool rescored = false;
};
using HeldOutSegments = std::vector<HeldOutSegment>;

// Tests what the segments show together against candidate and active version,
// with the track noise that the candidate has found
// (core/change/consistency.h). Of three segments or more, the one is left out
// without which the candidate fits best: a single segment that fits nothing
// proves nothing. Those that were linearised too far from the candidate are
// left out and counted; the active version, of the same segments, is taken
// linearly however far it is.
HeldOutTest TestHeldOut(const Rig& rig,
                        const KnownCalibration& candidate,
                        const KnownCalibration& active,
                        const HeldOutSegments& segments);

}  // namespace selfcal::server
