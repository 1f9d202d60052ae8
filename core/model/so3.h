// Rotations: exponential and logarithm of SO(3), and its Jacobians, which every
// factor uses.
//
// Conventions of the whole project: quaternions are Hamilton and unit, R_AB
// transforms coordinates in B into coordinates in A, and a rotation is
// perturbed on the right, R_AB Exp(delta), with delta in rad in frame B. Pure
// functions, callable from any thread.
//
// Source: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in
// robotics" (2018), appendix B.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace selfcal {

// Matrix [v]x with [v]x u = v x u.
Eigen::Matrix3d Skew(const Eigen::Vector3d& v);

// Unit quaternion of the rotation vector phi [rad]; uses a series near zero.
Eigen::Quaterniond Exp(const Eigen::Vector3d& phi);

// Rotation vector [rad] of the shorter rotation, with a norm in [0, pi].
// Accurate also near zero and near pi; q and -q give the same vector.
Eigen::Vector3d Log(const Eigen::Quaterniond& q);

// J_r(phi): Exp(phi + d) = Exp(phi) Exp(J_r(phi) d) to first order.
Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& phi);

// J_r(phi)^-1: Log(Exp(phi) Exp(d)) = phi + J_r(phi)^-1 d to first order.
Eigen::Matrix3d RightJacobianInverse(const Eigen::Vector3d& phi);

}  // namespace selfcal
