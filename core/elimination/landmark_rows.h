// Input format of the elimination for factors between a landmark, a keyframe
// and a camera: pairs of whitened rows whose columns are used several times.
//
//   [turn 3 | position 3 | own | residual | zeros up to a stride]
//
// represent the derivatives with respect to
//   the pose of the keyframe   [turn | position],
//   the landmark               -position,
//   n shared parameters        [-turn | own], with n - 3 own columns.
// If the body moves between its keyframe and the exposure, turn and position
// are those of the pose at the exposure, and the rows with respect to the
// rotation of the keyframe are [turn | position] B with a 6 x 3 matrix B.
//
// The rows of an image with a rolling shutter are exposed one after the other.
// Turn and position are then those of one pose for all of them, and the
// rotation of the camera acts at another: its columns are among n own ones.
#pragma once

namespace selfcal {

inline constexpr int kRowsTurn = 0;
inline constexpr int kRowsPosition = 3;
inline constexpr int kRowsOwn = 6;

// The columns of the rows of a camera.
struct LandmarkRows {
  int shared = 0;  // n
  bool rolling = false;

  constexpr int own() const { return rolling ? shared : shared - 3; }
  constexpr int residual() const { return kRowsOwn + own(); }
  // Doubles from one row to the next: whole vectors of any width.
  constexpr int stride() const { return (residual() + 1 + 7) / 8 * 8; }

  // The place of a shared parameter in a row, and whether it has the opposite
  // sign there.
  constexpr int Column(int parameter) const {
    return IsNegative(parameter) ? kRowsTurn + parameter
                                 : kRowsOwn + own() - shared + parameter;
  }
  constexpr bool IsNegative(int parameter) const {
    return !rolling && parameter < 3;
  }
};

}  // namespace selfcal
