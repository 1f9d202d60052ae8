// A link between a keyframe and the next, solved for the state of the former:
//   x0 = A e + G z,   e white with unit information.
#pragma once

namespace selfcal {

// Columns of G: z = (link parameters 15, velocity 3, b_a 3 and b_g 3 of the
// next keyframe, the constant 1, pose 6 of the next); the last is zero.
inline constexpr int kTransitionNextVelocity = 15;
inline constexpr int kTransitionNextAccelBias = 18;
inline constexpr int kTransitionConstant = 24;
inline constexpr int kTransitionNextPose = 25;
inline constexpr int kTransitionColumns = 32;
// Columns of A, the last of which is zero.
inline constexpr int kTransitionNoise = 16;

// Rows: pose 6, velocity 3, biases 6 of x0.
struct ChainTransition {
  alignas(64) double G[15][kTransitionColumns];
  double A[15][kTransitionNoise];
};

}  // namespace selfcal
