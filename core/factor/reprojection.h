// Reprojection factor as a plain function.
//
// A landmark is a homogeneous point (X, w) in G: p_G = X / w, so that infinity
// (w = 0) is not singular. Its image in the camera is
//   p_C ~ R_CI R_GI^T (X - w p_GI) + w p_CI,   residual = project(p_C) - z,
// with the pose of the body at the exposure: that of the keyframe or, if a
// motion is given, that of the keyframe moved by it to the camera's time offset
// and, if its shutter is a rolling one, to the row of z. The scale must not
// change its sign with w: (X, w) is the direction of X as w tends to zero, and
// (-X, -w) is behind a camera that observes (X, w). The residual is not
// whitened: the caller divides by the pixel sigma. Pure, callable from any
// thread. Source: Schneider et al., ICRA 2017, section III-C.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"

namespace selfcal {

struct ReprojectionJacobians {
  // Derivative with respect to the keyframe's pose (q_GI 3, p_GI 3), right
  // perturbation.
  Eigen::Matrix<double, 2, 6> pose;
  // Derivative with respect to the camera's tangent (q_CI 3, p_CI 3, f 2, c 2,
  // distortion, time offset, and line delay and time drift if it has them);
  // zero for those of time without a motion.
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxCameraTangentSize> camera;
  // Derivative with respect to (X, w). If w = 1 the first three columns are
  // with respect to p_G.
  Eigen::Matrix<double, 2, 4> landmark;
};

// Fills *residual_px (predicted minus measured) and, unless null, *jacobians.
// Returns false and changes neither if the point cannot be projected: there is
// then no residual, and the caller counts it.
bool Reproject(const Eigen::Quaterniond& q_GI,
               const Eigen::Vector3d& p_GI,
               const CameraCalibration& camera,
               const Eigen::Vector4d& landmark_G,
               const Eigen::Vector2d& z_px,
               Eigen::Vector2d* residual_px,
               ReprojectionJacobians* jacobians,
               const KeyframeMotion* motion = nullptr);

}  // namespace selfcal
