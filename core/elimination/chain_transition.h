// A link between a keyframe and the next, solved for the state of the former:
//   x0 = A e + G z,   e white with unit information.
#pragma once

#include "core/elimination/chain_unknowns.h"

namespace selfcal {

// Sizes in memory are whole vectors of any width.
inline constexpr int WholeVectors(int size) { return (size + 7) / 8 * 8; }

// Columns of G for a number of link parameters: z = (link parameters, velocity
// 3, b_a 3 and b_g 3 of the next keyframe, zeros up to whole vectors, the
// constant 1, pose 6 of the next, zeros up to whole vectors).
struct TransitionColumns {
  explicit constexpr TransitionColumns(int link_size)
      : link_size(link_size),
        motion_end(link_size + kChainMotionSize),
        constant(WholeVectors(motion_end)),
        next_pose(constant + 1),
        pose_end(next_pose + kChainPoseSize),
        stride(WholeVectors(pose_end)) {}

  int link_size;  // the velocity of the next keyframe comes next
  int motion_end;
  int constant;
  int next_pose;
  int pose_end;
  int stride;  // all
};

inline constexpr int kMaxTransitionColumns =
    TransitionColumns(kMaxChainLinkSize).stride;
// Columns of A, the last of which is zero.
inline constexpr int kTransitionNoise = WholeVectors(kChainStateSize);

// A view. Rows: pose 6, velocity 3, biases 6 of x0. The kernels load whole
// vectors of G.
struct ChainTransition {
  TransitionColumns columns;
  const double* G;  // 15 rows of columns.stride
  const double* A;  // 15 rows of kTransitionNoise
};

}  // namespace selfcal
