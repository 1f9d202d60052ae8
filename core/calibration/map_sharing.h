// Which landmarks of a map connect what lies far apart in a partition, so that
// a calibration costs what its segments cost, however often a SLAM system finds
// its landmarks again.
//
// A track falls into pieces: where the landmark is lost for long, where another
// chain of inertial links begins, and where it lasts for very long. Within a
// piece a landmark is eliminated among the few keyframes around it. One that
// connects pieces is an unknown of the linear system's dense interface
// (linear_system.h), which grows with each of them. So only a bounded number
// does, those with the most pieces first. Of all others each piece is a track
// of its own, and later a landmark of its own: that discards what the
// connection says, and claims nothing. Chains that are then connected by too
// little share theta alone.
#pragma once

#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/sharing_limits.h"

namespace selfcal {

// What is left of a partition. Chains are named by the index of their start.
struct SharedMap {
  std::vector<Track> tracks;  // by id, pieces of one id by time
  // Chains that are connected, sets sorted by their first.
  std::vector<std::vector<int>> connected;
};

// `tracks` are whole, and of the given chains: indices into `chain_starts`, the
// first keyframes of all chains of the problem, ascending. Chains are connected
// where they have more than merge_landmarks in common that are kept and will
// survive screening (`with_depth`, of each track): then one gauge is enough for
// them.
SharedMap ShareMap(const SharingLimits& limits,
                   int merge_landmarks,
                   std::span<const int> chain_starts,
                   const std::vector<int>& chains,
                   std::vector<Track> tracks,
                   const std::vector<bool>& with_depth);

}  // namespace selfcal
