#include "core/factor/landmark_anchor.h"

#include <Eigen/Geometry>

namespace selfcal {

Eigen::Vector4d LandmarkAnchor::ToHomogeneous(
    const Eigen::Vector3d& inverse_depth) const {
  const double rho = inverse_depth[2];
  Eigen::Vector4d landmark_G;
  landmark_G << R_GA * inverse_depth.head<2>().homogeneous() + rho * a_G, rho;
  return landmark_G;
}

Eigen::Vector3d LandmarkAnchor::FromPoint(const Eigen::Vector3d& p_G) const {
  const Eigen::Vector3d p_A = R_GA.transpose() * (p_G - a_G);
  return {p_A.x() / p_A.z(), p_A.y() / p_A.z(), 1 / p_A.z()};
}

}  // namespace selfcal
