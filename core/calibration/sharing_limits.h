// Limits of the connections between distant parts of a problem (map_sharing.h).
#pragma once

#include <limits>

namespace selfcal {

struct SharingLimits {
  // A landmark that is lost for more keyframes starts a new piece of its track.
  int max_lost = 10;
  // Keyframes from the first to the last of a piece: two segments of typical
  // length. Tracks of moving cameras are shorter.
  int max_length = 80;
  // Landmarks that connect pieces: of one chain, and of a whole partition.
  int of_chain = 32;
  int of_partition = 128;

  // Keeps all connections, at any cost.
  static constexpr SharingLimits None() {
    constexpr int kMax = std::numeric_limits<int>::max();
    return {.max_lost = kMax,
            .max_length = kMax,
            .of_chain = kMax,
            .of_partition = kMax};
  }
};

}  // namespace selfcal
