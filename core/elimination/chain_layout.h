// The places of the unknowns of a chain in its front (chain_front.h) and in
// panels over it. Internal to core/elimination.
#pragma once

#include <numeric>

#include "core/elimination/chain_places.h"
#include "core/elimination/chain_shape.h"

namespace selfcal {

// The front begins with `fixed` places for everything but poses: link
// parameters, motion, kept unknowns, camera parameters, the constant, padded
// to whole vectors.
struct ChainLayout {
  ChainLayout() = default;
  explicit ChainLayout(const ChainShape& shape)
      : camera_shared(std::accumulate(shape.cameras.begin(),
                                      shape.cameras.end(),
                                      0,
                                      [](int sum, const LandmarkRows& rows) {
                                        return sum + rows.shared;
                                      })),
        kept(shape.kept),
        camera_place(chain::kKeptPlace + WholeVectors(kept)),
        constant(camera_place + camera_shared),
        fixed(WholeVectors(constant + 1)) {}

  // Link parameters, camera parameters and kept unknowns.
  int shared_size() const { return kChainLinkShared + camera_shared + kept; }

  // Place of a shared parameter.
  int Place(int shared) const {
    if (shared < kChainLinkShared) return shared;
    const int camera = shared - kChainLinkShared;
    return camera < camera_shared ? camera_place + camera
                                  : chain::kKeptPlace + camera - camera_shared;
  }

  int camera_shared = 0;  // number of camera parameters
  int kept = 0;           // number of kept unknowns
  int camera_place = 0;   // of the first camera parameter
  int constant = 0;       // place of the constant
  int fixed = 0;
};

}  // namespace selfcal
