// Reprojection factors of one keyframe and camera, several at a time.
//
// The output is the rows of core/elimination/landmark_rows.h: a whitened factor
// has few distinct columns. A factor with zero weight gives zeros. If the body
// is moved to the exposure, rows are transformed by PoseTurn.
//
// Pure functions of their arguments, callable from any thread.
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

// The columns of the rows of a camera.
LandmarkRows RowsOf(const CameraCalibration& camera);

// The observations of one keyframe by one camera, as arrays.
struct ObservationRun {
  const KeyframeState* keyframe = nullptr;
  const CameraCalibration* camera = nullptr;
  int count = 0;
  const std::int32_t* landmarks = nullptr;  // indices into points
  const double* z_px = nullptr;             // 2 each
  // Motion to the exposure of the camera; null: the exposure is at the
  // keyframe, and derivatives with respect to the camera's time are zero.
  const KeyframeMotion* motion = nullptr;
};

// Matrix by which rows with respect to the pose at the exposure (of a rolling
// shutter: at the time of the motion) are multiplied to get those with respect
// to the rotation of the keyframe; nullopt if the poses are equal.
std::optional<Eigen::Matrix<double, 6, 3>> PoseTurn(const ObservationRun& run);

// Sums over the observations of a landmark for its refinement.
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

  // Writes 2 count rows of RowsOf(camera). `points` are homogeneous, 4
  // doubles (X, w) each with p_G = X / w; rows are with respect to the pose,
  // the camera, and p_G. The factors are multiplied by `weights`, one for each
  // observation, or by 1 / sigma_px if that is null. `rows` must have room for
  // 2 (count + 7) rows.
  void Linearise(const ObservationRun& run,
                 const double* points,
                 double sigma_px,
                 const double* weights,
                 double* rows) const;

  // Adds to the sums of each landmark, with respect to X, with a Huber loss of
  // huber_sigmas, and writes the squared norm of each residual [px^2]; negative
  // if the point cannot be projected.
  void AddLandmarkSums(const ObservationRun& run,
                       const double* points,
                       double sigma_px,
                       double huber_sigmas,
                       double* squares_px2,
                       LandmarkSums* sums) const;

  // Computes only the squared norms.
  void Squares(const ObservationRun& run,
               const double* points,
               double* squares_px2) const;

 private:
  VectorWidth width_;
};

}  // namespace selfcal
