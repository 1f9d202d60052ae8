// How the pixels that were fed follow from those that the intrinsics predict,
// if images were scaled or cropped. Internal to core/preflight.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/model/camera.h"
#include "core/preflight/views.h"

namespace selfcal {

// z_px = scale * predicted + shift_px. A resized image has no shift; where f
// alone is wrong by the scale, the principal point stays: shift = c (1 -
// scale).
struct ImageMap {
  double scale = 1;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  ReprojectionError error;
};

// Robust least squares (iterated, with the weights of Cauchy's distribution).
ImageMap FitImageMap(const std::vector<View>& views,
                     const CameraCalibration& camera);

}  // namespace selfcal
