// Reprojection factor as a plain function.
//
// A landmark is a homogeneous point (X, w) in G: p_G = X / w, so that infinity
// (w = 0) is harmless. Its image in the camera is
//   p_C ~ R_CI R_GI^T (X - w p_GI) + w p_CI,   residual = project(p_C) - z,
// with the body's pose at the exposure: the keyframe's, or where a motion is
// given, the keyframe's moved by it to the camera's time offset.
// The scale must not change its sign with w: (X, w) is the direction of X as w
// falls to zero, and (-X, -w) lies behind a camera that sees (X, w).
// Not whitened: the caller divides by the pixel sigma. Pure, any thread.
// Source: Schneider et al., ICRA 2017, section III-C.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"

namespace selfcal {

struct ReprojectionJacobians {
  // By the keyframe's pose (q_GI 3, p_GI 3), right perturbation.
  Eigen::Matrix<double, 2, 6> pose;
  // By the camera's tangent (q_CI 3, p_CI 3, f 2, c 2, distortion, time
  // offset); zero by the offset without a motion.
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 7 + kMaxIntrinsics> camera;
  // By (X, w). With w = 1 the first three columns are by p_G.
  Eigen::Matrix<double, 2, 4> landmark;
};

// Fills *residual_px (predicted minus measured) and, unless null, *jacobians.
// Returns false, leaving both untouched, where the point cannot be projected:
// that is no residual, and the caller counts it.
bool Reproject(const Eigen::Quaterniond& q_GI,
               const Eigen::Vector3d& p_GI,
               const CameraCalibration& camera,
               const Eigen::Vector4d& landmark_G,
               const Eigen::Vector2d& z_px,
               Eigen::Vector2d* residual_px,
               ReprojectionJacobians* jacobians,
               const KeyframeMotion* motion = nullptr);

}  // namespace selfcal
