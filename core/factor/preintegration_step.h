// One step of the scheme of preintegration.h: the rotation and motion of the
// body due to readings, and their derivatives. Internal to core/factor.
//
// T is double, or Lanes for several intervals at once. A step of length zero
// changes nothing: intervals with fewer samples than others in the batch are
// padded with such steps.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/model/so3_lanes.h"
#include "core/simd/lanes.h"

namespace selfcal::preintegration {

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;

// One raw reading, corrected; h_A = T_a^-1 (a~ - b_a) is the specific force in
// A.
template <typename T>
struct Reading {
  Vector3<T> w;
  Vector3<T> h_A;
  Vector3<T> f;
};

// The correction of readings, including the biases.
template <typename T>
struct Correction {
  Vector3<T> b_a, b_g;
  Matrix3<T> T_g_inverse, T_a_inverse, R_IA;

  Reading<T> operator()(const Vector3<T>& gyro, const Vector3<T>& accel) const {
    Reading<T> reading;
    reading.w = T_g_inverse * (gyro - b_g);
    reading.h_A = T_a_inverse * (accel - b_a);
    reading.f = R_IA * reading.h_A;
    return reading;
  }
};

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
// keyframe) and the forces at the latter two, in the frame of the first
// keyframe.
template <typename T>
struct Stage {
  T h;
  Matrix3<T> R_0, R_m, R_1;
  Vector3<T> f_m, f_1;
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

  Turn(T weight_0,
       T weight_1,
       T coning,
       const Reading<T>& r0,
       const Reading<T>& r1)
      : alpha(weight_0 * r0.w + weight_1 * r1.w),
        kappa(coning * r0.w.cross(r1.w)),
        phi(alpha + kappa),
        gain(weight_0 + weight_1),
        drift(coning * (r1.w - r0.w)) {}

  // Derivative with respect to phi of the left perturbation of the rotation
  // that follows R_0:
  //   Exp(phi + d) = Exp(J_l(phi) d) Exp(phi),   J_l(phi) = J_r(-phi).
  Matrix3<T> LeftJacobian(const Matrix3<T>& R_0) const {
    return R_0 * RightJacobian<T>(-phi);
  }
};

// Derivatives with respect to changes of the corrected rates: an offset of each
// axis 3, then a change of axis r in proportion to axis c, (r, c) = (0, 0), (1,
// 1), (2, 2), (0, 1), (0, 2), (1, 2). Those with respect to the raw readings
// follow from them, since T_g is upper triangular.
template <typename T>
using RateColumns = Eigen::Matrix<T, 3, 9>;

// A dphi for these changes, for a matrix A that is applied afterwards. With dw
// = e_r w_c,
//   dphi = alpha_c e_r + coning (w_0c e_r x w_1 + w_1c w_0 x e_r)
//        = alpha_c e_r + e_r x (kappa x e_c)
//        = alpha_c e_r - kappa_r e_c + (e_r . e_c) kappa.
template <typename T>
RateColumns<T> ByRates(const Matrix3<T>& A, const Turn<T>& turn) {
  RateColumns<T> J;
  J.template leftCols<3>() = turn.gain * A - TimesSkew(A, turn.drift);
  const Vector3<T> A_kappa = A * turn.kappa;
  for (int i = 0; i < 3; ++i) {
    J.col(3 + i) = (turn.alpha[i] - turn.kappa[i]) * A.col(i) + A_kappa;
  }
  J.col(6) = turn.alpha[1] * A.col(0) - turn.kappa[0] * A.col(1);
  J.col(7) = turn.alpha[2] * A.col(0) - turn.kappa[0] * A.col(2);
  J.col(8) = turn.alpha[2] * A.col(1) - turn.kappa[1] * A.col(2);
  return J;
}

// Contribution of a step to the motion's derivatives with respect to the rates:
// through its own rotation to (psi, Delta_v, Delta_p), psi a left perturbation.
// A force rotates with its rotation, d f = psi x f.
template <typename T>
struct RateResponse {
  RateColumns<T> psi, v, p;
};

// turn_m and turn_1: from the beginning of the step to its middle and its end.
template <typename T>
RateResponse<T> RespondToRates(const Stage<T>& s,
                               const Turn<T>& turn_m,
                               const Matrix3<T>& A_m,
                               const Turn<T>& turn_1) {
  const T sixth = s.h * (1.0 / 6);
  RateResponse<T> response;
  response.psi = ByRates<T>(turn_1.LeftJacobian(s.R_0), turn_1);
  const RateColumns<T> middle =
      ByRates<T>(Cross<T, 3>(-4.0 * sixth * s.f_m, A_m), turn_m);
  response.v = middle - Cross<T, 9>(sixth * s.f_1, response.psi);
  response.p = 0.5 * s.h * middle;
  return response;
}

// Contribution of a step to velocity and position for a constant force in the
// body.
template <typename T>
struct ForceResponse {
  Matrix3<T> v, p;
};

template <typename T>
ForceResponse<T> RespondToForce(const Stage<T>& s) {
  const T sixth = s.h * (1.0 / 6);
  return {sixth * (s.R_0 + 4.0 * s.R_m + s.R_1),
          sixth * s.h * (s.R_0 + 2.0 * s.R_m)};
}

}  // namespace selfcal::preintegration
