// Map from the pixels that the intrinsics predict to the received ones, for
// images that were scaled or cropped. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/camera.h"
#include "core/preflight/views.h"

namespace selfcal {

// z_px = scale * predicted + shift_px. A resized image has no shift; if only f
// is wrong by the scale, the principal point stays: shift = c (1 - scale).
struct ImageMap {
  double scale = 1;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  ReprojectionError error;
};

// Fits by robust least squares (iterated, with Cauchy weights).
ImageMap FitImageMap(const std::vector<View>& views,
                     const CameraCalibration& camera);

}  // namespace selfcal
