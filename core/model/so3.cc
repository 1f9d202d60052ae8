#include "core/model/so3.h"

#include "core/model/so3_lanes.h"

namespace selfcal {

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) { return Skew<double>(v); }

Eigen::Quaterniond Exp(const Eigen::Vector3d& phi) { return Exp<double>(phi); }

Eigen::Vector3d Log(const Eigen::Quaterniond& q) { return Log<double>(q); }

Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& phi) {
  return RightJacobian<double>(phi);
}

Eigen::Matrix3d RightJacobianInverse(const Eigen::Vector3d& phi) {
  return RightJacobianInverse<double>(phi);
}

}  // namespace selfcal
