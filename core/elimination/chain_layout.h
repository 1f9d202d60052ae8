// The places of the unknowns of a chain in its front (chain_front.h) and in
// panels over it. Internal to core/elimination.
#pragma once

#include <numeric>

#include "core/elimination/chain_places.h"
#include "core/elimination/chain_shape.h"

namespace selfcal {

// The front begins with `fixed` places for everything but poses: link
// parameters and motion, padded as in the columns of G, kept unknowns, camera
// parameters, the constant, padded to whole vectors.
struct ChainLayout {
  ChainLayout() = default;
  explicit ChainLayout(const ChainShape& shape)
      : link_size(shape.link_size),
        motion_size(shape.motion_size),
        camera_shared(std::accumulate(shape.cameras.begin(),
                                      shape.cameras.end(),
                                      0,
                                      [](int sum, const LandmarkRows& rows) {
                                        return sum + rows.shared;
                                      })),
        kept(shape.kept),
        kept_place(columns().constant),
        camera_place(kept_place + WholeVectors(kept)),
        constant(camera_place + camera_shared),
        fixed(WholeVectors(constant + 1)) {}

  // Link parameters, camera parameters and kept unknowns.
  int shared_size() const { return link_size + camera_shared + kept; }

  int state_size() const { return chain::kPose + motion_size; }
  TransitionColumns columns() const {
    return TransitionColumns(link_size, motion_size);
  }

  // Place of a shared parameter.
  int Place(int shared) const {
    if (shared < link_size) return shared;
    const int camera = shared - link_size;
    return camera < camera_shared ? camera_place + camera
                                  : kept_place + camera - camera_shared;
  }
  // Place of the velocity of the current keyframe; its biases follow.
  int motion_place() const { return link_size; }

  int link_size = 0;  // number of link parameters
  int motion_size = kChainMotionSize;
  int camera_shared = 0;  // number of camera parameters
  int kept = 0;           // number of kept unknowns
  int kept_place = 0;     // of the first kept unknown: the same as in G
  int camera_place = 0;   // of the first camera parameter
  int constant = 0;       // place of the constant
  int fixed = 0;
};

}  // namespace selfcal
