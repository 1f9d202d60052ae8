// What a chain consists of, without numerical values: keyframes, cameras, and
// which keyframe observes which landmark.
#pragma once

#include <span>

#include "core/elimination/landmark_rows.h"

namespace selfcal {

// The observations, as in ChainStructure::Find, and for each camera the rows of
// its observations. Its parameters are in the order of the cameras, after the
// link parameters.
struct ChainShape {
  int keyframes = 0;
  std::span<const LandmarkRows> cameras;
  std::span<const int> tracks;
  std::span<const int> track_keyframes;
  // Number of kept unknowns; and for each landmark the first of its three, or
  // -1 if it is eliminated. Empty: all are eliminated.
  int kept = 0;
  std::span<const int> kept_landmarks = {};
};

}  // namespace selfcal
