// The form in which factors between a landmark, a keyframe and a camera come to
// the elimination: pairs of whitened rows whose columns count more than once.
//
//   [turn 3 | position 3 | own n - 3 | residual | zeros up to a stride]
//
// stand for the derivatives
//   by the pose of the keyframe   [turn | position],
//   by the landmark               -position,
//   by n shared parameters        [-turn | own].
// Where the body moves on from its keyframe before it sees, turn and position
// are those of the pose that sees, and by the turn of the keyframe the rows are
// [turn | position] B with some 6 x 3 matrix B.
#pragma once

namespace selfcal {

inline constexpr int kRowsTurn = 0;
inline constexpr int kRowsPosition = 3;
inline constexpr int kRowsOwn = 6;
inline constexpr int RowsResidual(int shared) { return shared + 3; }
// Doubles from one row to the next: whole vectors of any width.
inline constexpr int RowsStride(int shared) { return (shared + 4 + 7) / 8 * 8; }

}  // namespace selfcal
