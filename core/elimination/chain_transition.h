// A link between a keyframe and the next, solved for the state of the former:
//   x0 = A e + G z,   e white with unit information.
#pragma once

#include "core/elimination/chain_unknowns.h"

namespace selfcal {

// Sizes in memory are whole vectors of any width.
inline constexpr int WholeVectors(int size) { return (size + 7) / 8 * 8; }

// Columns of G: z = (link parameters, velocity 3, b_a 3 and b_g 3 of the next
// keyframe, zeros up to whole vectors, the constant 1, pose 6 of the next,
// zeros up to whole vectors).
inline constexpr int kTransitionNextVelocity = kChainLinkShared;
inline constexpr int kTransitionNextAccelBias = kTransitionNextVelocity + 3;
inline constexpr int kTransitionMotionEnd =
    kTransitionNextVelocity + kChainMotionSize;
inline constexpr int kTransitionConstant = WholeVectors(kTransitionMotionEnd);
inline constexpr int kTransitionNextPose = kTransitionConstant + 1;
inline constexpr int kTransitionPoseEnd = kTransitionNextPose + kChainPoseSize;
inline constexpr int kTransitionColumns = WholeVectors(kTransitionPoseEnd);
// Columns of A, the last of which is zero.
inline constexpr int kTransitionNoise = WholeVectors(kChainStateSize);

// Rows: pose 6, velocity 3, biases 6 of x0.
struct ChainTransition {
  alignas(64) double G[kChainStateSize][kTransitionColumns];
  double A[kChainStateSize][kTransitionNoise];
};

}  // namespace selfcal
