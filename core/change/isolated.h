// Segments that show another theta than their neighbours in time do.
//
// A device that has changed stays changed: the first segment after a change
// contradicts the one before it, and agrees with the next. A segment that
// contradicts both is corrupt, or of another device. Several of these among the
// newest segments would make a change of any course, whichever one of them is
// left out.
//
// Pure, deterministic, any thread.
#pragma once

#include <span>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

// Indices of the isolated ones among segments in the order of time, ascending.
// Contradictions are measured by how much neighbours usually differ, since
// noise may be larger than segments claim. The first and the last have one
// neighbour, and are isolated where they contradict that.
std::vector<int> FindIsolated(std::span<const OffsetInformation> segments);

}  // namespace selfcal
