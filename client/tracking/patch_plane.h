// The plane on which a patch of an image is described: that across its ray, at
// a unit distance from the camera, with the map from pixels to it.
//
// The planes of a patch in two images are related by the homography that a flat
// surface and the motion of the camera induce. Its first order is the
// affine warp that the tracker estimates; its second order follows from that
// warp, if the rotation between both images is known: the angle between the two
// rays (the parallax) is then known, and the warp shows how the distance of the
// surface changes along it. Left out, it would move points by a hundredth of a
// pixel, alike on a whole wall.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "client/tracking/lens_curvature.h"
#include "core/model/camera.h"

namespace selfcal::client {

struct PatchPlane {
  LensCurvature curvature = LensCurvature::Zero();
  // Derivative of the plane by the pixel.
  Eigen::Matrix2d by_pixel = Eigen::Matrix2d::Identity();
  // Both axes of the plane and the ray, as columns, in a frame that does not
  // rotate; nullopt if the rotation of the camera is not known.
  std::optional<Eigen::Matrix3d> axes_G = std::nullopt;
};

// The plane of a pixel. `q_GC` is the rotation of the camera at its exposure,
// if it is known. A pixel without a ray has the plane of an image without lens.
PatchPlane PlaneAt(const CameraCalibration& camera,
                   const Eigen::Vector2d& z_px,
                   const std::optional<Eigen::Quaterniond>& q_GC);

// The second order of the map of a patch from one image to another, whose first
// order is A: of both lenses and, if the rotations are known, of the
// perspective.
LensCurvature SecondOrderOfWarp(const PatchPlane& from,
                                const Eigen::Matrix2d& A,
                                const PatchPlane& to);

}  // namespace selfcal::client
