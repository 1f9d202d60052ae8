// Finds segments with another theta than their neighbours in time.
//
// A device that has changed stays changed: the first segment after a change
// contradicts the previous one, and agrees with the next. A segment that
// contradicts both is corrupt, or from another device. Several of these among
// the newest segments would look like a change of some course, even with any
// one of them excluded.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <span>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

// Returns the indices of the isolated ones among segments in the order of time,
// ascending. Contradictions are measured relative to the typical difference of
// neighbours, since noise may be larger than segments claim. The first and the
// last have one neighbour, and are isolated if they contradict that.
std::vector<int> FindIsolated(std::span<const OffsetInformation> segments);

}  // namespace selfcal
