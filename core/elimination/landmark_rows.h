// Input format of the elimination for factors between a landmark, a keyframe
// and a camera: pairs of whitened rows whose columns are used several times.
//
//   [turn 3 | position 3 | own n - 3 | residual | zeros up to a stride]
//
// represent the derivatives with respect to
//   the pose of the keyframe   [turn | position],
//   the landmark               -position,
//   n shared parameters        [-turn | own].
// If the body moves between its keyframe and the exposure, turn and position
// are those of the pose at the exposure, and the rows with respect to the
// rotation of the keyframe are [turn | position] B with a 6 x 3 matrix B.
#pragma once

namespace selfcal {

inline constexpr int kRowsTurn = 0;
inline constexpr int kRowsPosition = 3;
inline constexpr int kRowsOwn = 6;
inline constexpr int RowsResidual(int shared) { return shared + 3; }
// Doubles from one row to the next: whole vectors of any width.
inline constexpr int RowsStride(int shared) { return (shared + 4 + 7) / 8 * 8; }

}  // namespace selfcal
