// How a linear system is eliminated: its chains of keyframes, and which
// unknowns each of them keeps for the interface.
#pragma once

#include <span>
#include <vector>

#include "core/calibration/linear_observations.h"
#include "core/calibration/linear_point.h"
#include "core/elimination/chain_elimination.h"
#include "core/model/second_imu.h"

namespace selfcal {

// Keyframes [begin, end) of a problem that are connected by inertial links.
struct KeyframeChain {
  int begin = 0;
  int end = 0;
};

// Half of a walk of the biases over a gap, between a keyframe at an end of a
// chain and the biases in the middle of the walk.
struct HalfWalk {
  int kept = -1;  // the first of its six kept unknowns; -1: there is none
  KeptBiasRows rows;
};

struct ChainPlan {
  KeyframeChain range;
  int theta = 0;  // its theta_s, an index into ChainThetas
  // A piece of the track of a landmark is a landmark of the chain: its index
  // in the problem, its keyframes as ChainShape has them, and the first of its
  // kept unknowns, or -1.
  std::vector<int> landmarks;
  std::vector<int> tracks, track_keyframes;
  std::vector<int> kept_landmarks;
  // Index in the interface of each kept unknown.
  std::vector<int> interface;
  // Into the first keyframe, and out of the last.
  HalfWalk walk_in, walk_out;

  int keyframes() const { return range.end - range.begin; }
  ChainShape Shape(const Calibration& theta_s,
                   std::span<const LandmarkRows> cameras) const {
    return {keyframes(),
            LinkTangentSize(theta_s),
            cameras,
            tracks,
            track_keyframes,
            static_cast<int>(interface.size()),
            kept_landmarks,
            StateTangentSize(theta_s) - kChainPoseSize};
  }
};

struct EliminationPlan {
  std::vector<ChainPlan> chains;
  // Size of the interface, and in it the first unknown of each landmark, or -1.
  int interface_size = 0;
  std::vector<int> interface_of_landmark;
  // Sum of the squares of all walks at the estimate, with the middle of each
  // where it is least.
  double walk_squares = 0;
};

// Plans the elimination of weighted observations: those with a weight, of
// landmarks with enough of them, get a factor. The memory of the previous plan
// is reused.
void PlanElimination(const LinearPoint& point,
                     LinearObservations* observations,
                     EliminationPlan* plan);

}  // namespace selfcal
