// The places of the unknowns of a chain in its front (chain_front.h) and in
// panels over it. Internal to core/elimination.
#pragma once

#include <numeric>

#include "core/elimination/chain_places.h"
#include "core/elimination/chain_shape.h"

namespace selfcal {

// The front begins with `fixed` places for everything but poses: link
// parameters, motion, kept unknowns, landmark parameters, the constant, padded
// to whole vectors.
struct ChainLayout {
  ChainLayout() = default;
  explicit ChainLayout(const ChainShape& shape)
      : landmark_shared(std::accumulate(
            shape.camera_sizes.begin(), shape.camera_sizes.end(), 0)),
        kept(shape.kept),
        landmark_place(chain::kKeptPlace + WholeVectors(kept)),
        constant(landmark_place + landmark_shared),
        fixed(WholeVectors(constant + 1)) {}

  // Link parameters, landmark parameters and kept unknowns.
  int shared_size() const { return kChainLinkShared + landmark_shared + kept; }

  // Place of a shared parameter.
  int Place(int shared) const {
    if (shared < kChainLinkShared) return shared;
    const int landmark = shared - kChainLinkShared;
    return landmark < landmark_shared
               ? landmark_place + landmark
               : chain::kKeptPlace + landmark - landmark_shared;
  }

  int landmark_shared = 0;  // number of landmark parameters
  int kept = 0;             // number of kept unknowns
  int landmark_place = 0;   // of the first landmark parameter
  int constant = 0;         // place of the constant
  int fixed = 0;
};

}  // namespace selfcal
