// A unit quaternion as a parameter block of Ceres, in Eigen's order of storage
// (x, y, z, w). Internal to core/factor.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace selfcal {

inline Eigen::Quaterniond ReadQuaternion(const double* q) {
  return Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(q));
}

// d (q Exp(d)) / d d at d = 0: half of q times a pure quaternion. Its columns
// are orthogonal to each other and to q, each of length 1/2.
inline Eigen::Matrix<double, 4, 3> QuaternionPlusJacobian(
    const Eigen::Quaterniond& q) {
  Eigen::Matrix<double, 4, 3> J;
  // clang-format off
  J <<  q.w(), -q.z(),  q.y(),
        q.z(),  q.w(), -q.x(),
       -q.y(),  q.x(),  q.w(),
       -q.x(), -q.y(), -q.z();
  // clang-format on
  return 0.5 * J;
}

// Derivative of Log(q^-1 y) with respect to y at y = q. It is the left inverse
// of the above that does not depend on the norm of q. A Jacobian with respect
// to the rotation's right perturbation times this is one with respect to the
// four numbers, for any manifold on them.
inline Eigen::Matrix<double, 3, 4> QuaternionMinusJacobian(
    const Eigen::Quaterniond& q) {
  return 4 * QuaternionPlusJacobian(q).transpose();
}

}  // namespace selfcal
