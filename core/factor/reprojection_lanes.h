// The kernels of reprojection_batch.h, for one vector width. Internal to
// core/factor.
#pragma once

#include "core/factor/reprojection_batch.h"
#include "core/model/camera_models.h"

namespace selfcal {

// The pose at the exposure and the camera as plain numbers; matrices are
// row-major.
struct RunGeometry {
  double R_IG[9];
  double p_GI[3];
  double R_CI[9];
  double p_CI[3];
  double
      by_offset[6];  // derivative of the pose with respect to the time offset
  PixelMap pixels;
  // A rolling shutter has more: the ReadoutMotion, its matrices by columns; the
  // time of the first row, from that of the motion on; and the line delay.
  double turn[9];
  double shift[9];
  double rate_share;
  double first_row_s;
  double line_delay_s;
};

template <int W, class Model, bool kRolling>
struct ReprojectionLanes {
  static void Linearise(const RunGeometry& geometry,
                        const Model& model,
                        const ObservationRun& run,
                        const double* points,
                        double sigma_px,
                        const double* weights,
                        double* rows);
  static void AddLandmarkSums(const RunGeometry& geometry,
                              const Model& model,
                              const ObservationRun& run,
                              const double* points,
                              double sigma_px,
                              double huber_sigmas,
                              double* squares_px2,
                              LandmarkSums* sums);
  static void Squares(const RunGeometry& geometry,
                      const Model& model,
                      const ObservationRun& run,
                      const double* points,
                      double* squares_px2);
};

}  // namespace selfcal
