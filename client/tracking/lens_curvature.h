// The bending of a patch of an image by the lens: the second order of the map
// from pixels to the plane across the ray of the patch.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>

#include "core/model/camera.h"

namespace selfcal::client {

// A point x of the patch, relative to its centre [px], is seen where a lens
// without curvature would see x + C (x_0^2, x_0 x_1, x_1^2)^T.
using LensCurvature = Eigen::Matrix<double, 2, 3>;

// The curvature at a pixel. Zero where the model has no rays about it.
LensCurvature CurvatureAt(const CameraCalibration& camera,
                          const Eigen::Vector2d& z_px);

// The second order of the map of a patch from one image to another, whose first
// order is A: what the lens bends at both places.
LensCurvature CurvatureOfWarp(const LensCurvature& from,
                              const Eigen::Matrix2d& A,
                              const LensCurvature& to);

}  // namespace selfcal::client
