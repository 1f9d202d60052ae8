// Landmarks by inverse depth: (alpha, beta, rho) relative to a fixed anchor, so
// that a landmark at infinity is a regular one, with rho = 0.
#pragma once

#include <Eigen/Core>

namespace selfcal {

// Fixed frame relative to which a landmark is parametrised by inverse depth.
struct LandmarkAnchor {
  Eigen::Matrix3d R_GA = Eigen::Matrix3d::Identity();
  Eigen::Vector3d a_G = Eigen::Vector3d::Zero();  // [m]

  // Homogeneous point in G of (alpha, beta, rho), and the inverse.
  Eigen::Vector4d ToHomogeneous(const Eigen::Vector3d& inverse_depth) const;
  Eigen::Vector3d FromPoint(const Eigen::Vector3d& p_G) const;
};

}  // namespace selfcal
