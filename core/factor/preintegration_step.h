// One step of the scheme of preintegration.h, and how its rotations respond to
// the gyroscope. Internal to core/factor.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/model/so3.h"

namespace selfcal::preintegration {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// One raw reading, corrected; h_A = T_a^-1 (a~ - b_a) is the specific force
// still in A.
struct Reading {
  Vector3d w;
  Vector3d h_A;
  Vector3d f;
};

// a x each column of M, [a]x M.
template <int cols>
Eigen::Matrix<double, 3, cols> Cross(const Vector3d& a,
                                     const Eigen::Matrix<double, 3, cols>& M) {
  return M.colwise().cross(-a);
}

// M [a]x.
inline Matrix3d TimesSkew(const Matrix3d& M, const Vector3d& a) {
  return M.rowwise().cross(a.transpose());
}

// One step: rotations at its beginning, middle and end (body there to the first
// keyframe) and the forces at the three, in the frame of the first keyframe.
struct Stage {
  double h;
  Matrix3d R_0, R_m, R_1;
  Vector3d f_0, f_m, f_1;
  // Integral and double integral of the force over the step.
  Vector3d dv, dp;
};

// Derivative of a left perturbation of a rotation within the step by the raw
// gyroscope readings at its beginning and end.
struct Turn {
  Matrix3d by_0, by_1;
  Matrix3d by_both() const { return by_0 + by_1; }
};

// For the rotation by phi = weight_0 w_0 + weight_1 w_1 + coning w_0 x w_1 that
// follows R_0: Exp(phi + d) = Exp(J_l(phi) d) Exp(phi), J_l(phi) = J_r(-phi).
inline Turn TurnOf(const Matrix3d& R_0,
                   const Vector3d& phi,
                   const Vector3d& w_0,
                   const Vector3d& w_1,
                   double weight_0,
                   double weight_1,
                   double coning,
                   const Matrix3d& T_g_inverse) {
  const Matrix3d A = R_0 * RightJacobian(-phi);
  return {(weight_0 * A - TimesSkew(A, coning * w_1)) * T_g_inverse,
          (weight_1 * A + TimesSkew(A, coning * w_0)) * T_g_inverse};
}

}  // namespace selfcal::preintegration
