// What a chain consists of, without numerical values: keyframes, cameras, and
// which keyframe observes which landmark.
#pragma once

#include <span>

#include "core/elimination/chain_unknowns.h"
#include "core/elimination/landmark_rows.h"

namespace selfcal {

// The number of link parameters, for each camera the rows of its observations,
// whose parameters follow in the order of the cameras, and the observations, as
// in ChainStructure::Find.
struct ChainShape {
  int keyframes = 0;
  int link_size = 0;  // at most kMaxChainLinkSize
  std::span<const LandmarkRows> cameras;
  std::span<const int> tracks;
  std::span<const int> track_keyframes;
  // Number of kept unknowns; and for each landmark the first of its three, or
  // -1 if it is eliminated. Empty: all are eliminated.
  int kept = 0;
  std::span<const int> kept_landmarks = {};
  // Number of unknowns of a keyframe besides its pose.
  int motion_size = kChainMotionSize;
  // Most that the tracks may take, as ChainStructure::Bytes; 0: no limit.
  std::size_t max_bytes = 0;
};

}  // namespace selfcal
