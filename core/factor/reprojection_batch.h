// The reprojection factors of one keyframe and camera, several at a time.
//
// What is written are the rows of core/elimination/landmark_rows.h: a whitened
// factor has few columns that differ. A factor without weight gives zeros.
// Where the body is moved to the exposure, they turn as PoseTurn says.
//
// Pure functions of their arguments, any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "core/elimination/landmark_rows.h"
#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// The observations of one keyframe by one camera, as arrays.
struct ObservationRun {
  const KeyframeState* keyframe = nullptr;
  const CameraCalibration* camera = nullptr;
  int count = 0;
  const std::int32_t* landmarks = nullptr;  // indices into points
  const double* z_px = nullptr;             // 2 each
  // To the exposure of the camera; null: it is that of the keyframe, and rows
  // are zero by the time offset.
  const KeyframeMotion* motion = nullptr;
};

// What the rows by the pose at the exposure are multiplied with to be those by
// the turn of the keyframe; nothing where the poses are the same.
std::optional<Eigen::Matrix<double, 6, 3>> PoseTurn(const ObservationRun& run);

// Sums over the observations of a landmark that its refinement needs.
struct LandmarkSums {
  // Weighted J^T J (00 10 11 20 21 22) and J^T r, cost of the robust losses
  // [sigma^2], and the number of observations that project.
  double values[11] = {};

  double H(int i, int j) const {
    return values[i * (i + 1) / 2 + j];
  }  // j <= i
  double g(int i) const { return values[6 + i]; }
  double cost() const { return values[9]; }
  double projected() const { return values[10]; }
};

class ReprojectionBatch {
 public:
  explicit ReprojectionBatch(VectorWidth width = WidestVectors())
      : width_(width) {}

  // Writes 2 count rows of RowsStride(n) doubles. `points` are homogeneous, 4
  // doubles (X, w) each with p_G = X / w; rows are by the pose, the camera, and
  // by p_G. The factors are multiplied by `weights`, one for each observation,
  // or where it is null by 1 / sigma_px. `rows` has room for 2 (count + 7)
  // rows.
  void Linearise(const ObservationRun& run,
                 const double* points,
                 double sigma_px,
                 const double* weights,
                 double* rows) const;

  // Adds to the sums of each landmark, by X, under a Huber loss of
  // huber_sigmas, and writes the squared norm of each residual [px^2]; negative
  // where the point cannot be projected.
  void AddLandmarkSums(const ObservationRun& run,
                       const double* points,
                       double sigma_px,
                       double huber_sigmas,
                       double* squares_px2,
                       LandmarkSums* sums) const;

  // Only the squared norms.
  void Squares(const ObservationRun& run,
               const double* points,
               double* squares_px2) const;

 private:
  VectorWidth width_;
};

}  // namespace selfcal
