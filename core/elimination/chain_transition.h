// A link between a keyframe and the next, solved for the state of the former:
//   x0 = A e + G z,   e white with unit information.
// A link whose measurements are more than the unknowns of a state says
// something of z as well: further rows H z, each white with unit information.
#pragma once

#include "core/elimination/chain_unknowns.h"

namespace selfcal {

// Sizes in memory are whole vectors of any width.
inline constexpr int WholeVectors(int size) { return (size + 7) / 8 * 8; }

// Columns of G for a number of link parameters: z = (link parameters, motion of
// the next keyframe, zeros up to whole vectors, the constant 1, pose 6 of the
// next, zeros up to whole vectors).
struct TransitionColumns {
  explicit constexpr TransitionColumns(int link_size,
                                       int motion_size = kChainMotionSize)
      : link_size(link_size),
        motion_size(motion_size),
        motion_end(link_size + motion_size),
        constant(WholeVectors(motion_end)),
        next_pose(constant + 1),
        pose_end(next_pose + kChainPoseSize),
        stride(WholeVectors(pose_end)) {}

  int state_size() const { return kChainPoseSize + motion_size; }

  int link_size;  // the velocity of the next keyframe comes next
  int motion_size;
  int motion_end;
  int constant;
  int next_pose;
  int pose_end;
  int stride;  // all
};

inline constexpr int kMaxTransitionColumns =
    TransitionColumns(kMaxChainLinkSize, kMaxChainMotionSize).stride;
// Columns of A for one IMU, the last of which is zero.
inline constexpr int kTransitionNoise = WholeVectors(kChainStateSize);

// A view. Rows of G and A are those of x0. The kernels load whole vectors of G.
struct ChainTransition {
  // The stride of A; columns beyond those of the state are zero.
  int noise() const { return WholeVectors(columns.state_size()); }

  TransitionColumns columns;
  const double* G;            // rows of columns.stride
  const double* A;            // rows of noise()
  int rows = 0;               // at most kMaxChainLinkRows
  const double* H = nullptr;  // rows of columns.stride
};

}  // namespace selfcal
