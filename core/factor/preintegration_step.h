// One step of the scheme of preintegration.h: the rotation and motion of the
// body due to readings. Internal to core/factor.
//
// T is double, or Lanes for several intervals at once. A step of length zero
// changes nothing: intervals with fewer samples than others in the batch are
// padded with such steps.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/model/imu_model.h"
#include "core/model/so3_lanes.h"
#include "core/simd/lanes.h"

namespace selfcal::preintegration {

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;

template <typename T>
using Reading = CorrectedReading<T>;

// a x each column of M, [a]x M.
template <typename T, int cols>
Eigen::Matrix<T, 3, cols> Cross(const Vector3<T>& a,
                                const Eigen::Matrix<T, 3, cols>& M) {
  Eigen::Matrix<T, 3, cols> product;
  for (int c = 0; c < cols; ++c) {
    product(0, c) = a[1] * M(2, c) - a[2] * M(1, c);
    product(1, c) = a[2] * M(0, c) - a[0] * M(2, c);
    product(2, c) = a[0] * M(1, c) - a[1] * M(0, c);
  }
  return product;
}

// M [a]x.
template <typename T>
Matrix3<T> TimesSkew(const Matrix3<T>& M, const Vector3<T>& a) {
  Matrix3<T> product;
  product.col(0) = a[2] * M.col(1) - a[1] * M.col(2);
  product.col(1) = a[0] * M.col(2) - a[2] * M.col(0);
  product.col(2) = a[1] * M.col(0) - a[0] * M.col(1);
  return product;
}

// One step: rotations at its beginning, middle and end (body there to the first
// keyframe) and the forces there, in the frame of the first keyframe.
template <typename T>
struct Stage {
  T h;
  Matrix3<T> R_0, R_m, R_1;
  Vector3<T> f_0, f_m, f_1;
  // Integral and double integral of the force over the step.
  Vector3<T> dv, dp;
};

// The rotation by phi = alpha + kappa within a step: alpha linear in the rates
// w_0 and w_1 of its ends, kappa = coning w_0 x w_1.
template <typename T>
struct Turn {
  Vector3<T> alpha, kappa, phi;
  // A change d of both rates changes phi by gain d + d x drift.
  T gain;
  Vector3<T> drift;
  T weight_0, weight_1, coning;

  Turn(T weight_0,
       T weight_1,
       T coning,
       const Reading<T>& r0,
       const Reading<T>& r1)
      : alpha(weight_0 * r0.w + weight_1 * r1.w),
        kappa(coning * r0.w.cross(r1.w)),
        phi(alpha + kappa),
        gain(weight_0 + weight_1),
        drift(coning * (r1.w - r0.w)),
        weight_0(weight_0),
        weight_1(weight_1),
        coning(coning) {}

  // Derivative with respect to phi of the left perturbation of the rotation
  // that follows R_0:
  //   Exp(phi + d) = Exp(J_l(phi) d) Exp(phi),   J_l(phi) = J_r(-phi).
  Matrix3<T> LeftJacobian(const Matrix3<T>& R_0) const {
    return R_0 * RightJacobian<T>(-phi);
  }
};

}  // namespace selfcal::preintegration
