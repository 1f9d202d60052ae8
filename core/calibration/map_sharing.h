// Selects the landmarks of a map that may connect distant parts of a partition,
// so that the cost of a calibration depends on its segments only, however often
// a SLAM system recognises its landmarks again.
//
// A track is split into pieces: where the landmark is lost for long, where
// another chain of inertial links begins, and where it lasts very long. Within
// a piece a landmark is eliminated among the few keyframes around it. One that
// connects pieces is an unknown of the linear system's dense interface
// (linear_system.h), which grows with each of them. Therefore only a bounded
// number connects, those with the most pieces first. For all others each piece
// is a separate track, and later a separate landmark: that discards the
// information of the connection, and adds none. Chains that are then connected
// by too little share only theta.
#pragma once

#include <span>
#include <vector>

#include "core/calibration/problem.h"
#include "core/calibration/sharing_limits.h"

namespace selfcal {

// The shared map of a partition. Chains are identified by the index of their
// start.
struct SharedMap {
  std::vector<Track> tracks;  // by id, pieces of one id by time
  // Sets of connected chains, sorted by their first.
  std::vector<std::vector<int>> connected;
};

// `tracks` are complete, and belong to the given chains: indices into
// `chain_starts`, the first keyframes of all chains of the problem, ascending.
// Chains are connected if they share more than merge_landmarks kept landmarks
// that will survive screening (`with_depth`, for each track): one gauge then
// suffices for them.
SharedMap ShareMap(const SharingLimits& limits,
                   int merge_landmarks,
                   std::span<const int> chain_starts,
                   const std::vector<int>& chains,
                   std::vector<Track> tracks,
                   const std::vector<bool>& with_depth);

}  // namespace selfcal
