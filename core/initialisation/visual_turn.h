// The rotation of a camera between two images, from their points alone.
// Internal to core/initialisation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "core/initialisation/epipolar_check.h"
#include "core/initialisation/image_rays.h"

namespace selfcal {

// The rotation R that maximises the trace of R^T moments: of vectors a to b,
// if the moments are the sum of weight b a^T (Kabsch 1976).
Eigen::Quaterniond RotationOfMoments(const Eigen::Matrix3d& moments);

// R_BA of points at infinity, with weights that narrow from residuals of large
// rotations to those of parallax: what disagrees loses its influence.
Eigen::Quaterniond RotationOfDistantPoints(const std::vector<RayPair>& pairs);

struct VisualTurn {
  double from_s = 0;  // exposure of the middle row, without the time offset
  double to_s = 0;
  Eigen::Vector3d turn_C = Eigen::Vector3d::Zero();  // Log(R_C0C1) [rad]
};

// The rotation of each pair: that of distant points, corrected by an epipolar
// fit, since near ones move by the translation.
std::vector<VisualTurn> VisualTurns(const RayImages& rays,
                                    const std::vector<ImagePair>& pairs);

}  // namespace selfcal
