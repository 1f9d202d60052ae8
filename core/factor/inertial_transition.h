// The linearised inertial factor solved for the earlier state, as a template
// over the scalar, for several links at once. Internal to core/factor.
//
// With rows as in inertial.h and psi, v, p the derivatives of the measured
// motion (psi a left perturbation of Delta_R), the Jacobian with respect to the
// earlier state has an inverse in closed form. If the residual changes by y,
//
//   rotation  theta = -R_01 J_r(r) y_rotation
//   velocity  R_GI (v_01 x theta - y_velocity)
//   position  R_GI (p_01 x theta - y_position) - dt velocity
//
// is the change of the state that compensates -y, for y without components in
// the biases. For the derivatives of the measured motion, y_rotation is
// -J_l(r)^-1 Delta_R^T psi, and theta becomes -psi.
#pragma once

#include <Eigen/Core>

#include "core/elimination/small_cholesky.h"
#include "core/factor/inertial_batch.h"
#include "core/factor/inertial_terms.h"
#include "core/factor/preintegration_bias_walk.h"
#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_jacobians.h"

namespace selfcal::inertial {

using preintegration::Matrix3;
using preintegration::Vector3;

// The members that the residual uses.
template <typename T>
struct State {
  Eigen::Quaternion<T> q_GI;
  Vector3<T> p_GI, v_GI, b_a, b_g;
};

// Same as InertialNoiseRoot: U with U U^T the covariance of the residual.
template <typename T>
struct NoiseRoot {
  Eigen::Matrix<T, 9, 9> motion;  // upper triangle; the lower is not set
  Eigen::Matrix<T, 9, 6> motion_by_bias;
  Eigen::Matrix<T, 6, 1> bias;
};

// Overwrites the upper triangle of C by U with U U^T = C; never NaN. If
// rounding left C far from a covariance, no entry of U exceeds the standard
// deviation of its row.
template <typename T>
void UpperRoot(Eigen::Matrix<T, 9, 9>* C) {
  Eigen::Matrix<T, 9, 9>& U = *C;
  Eigen::Matrix<T, 9, 1> sigma;
  for (int i = 0; i < 9; ++i) sigma[i] = Sqrt(Max(U(i, i), T(1e-300)));
  for (int j = 8; j >= 0; --j) {
    T pivot = U(j, j);
    for (int k = j + 1; k < 9; ++k) pivot -= U(j, k) * U(j, k);
    U(j, j) = Sqrt(Max(pivot, kPivotFloor * sigma[j] * sigma[j]));
    const T inverse = 1.0 / U(j, j);
    for (int i = 0; i < j; ++i) {
      T sum = U(i, j);
      for (int k = j + 1; k < 9; ++k) sum -= U(i, k) * U(j, k);
      U(i, j) = Max(-sigma[i], Min(sigma[i], sum * inverse));
    }
  }
}

// `by_psi` is the negative derivative of the rotation residual with respect to
// psi. Requires root->bias, the standard deviations of the walks.
template <typename T>
void RootOfMotionCovariance(
    const preintegration::MotionCovariance<T>& covariance,
    const preintegration::BiasWalk<T>& walk,
    const Matrix3<T>& by_psi,
    NoiseRoot<T>* root) {
  // Every error of the motion enters the residual with a negative sign.
  const Matrix3<T> with_gyro = -1.0 / root->bias[3] * walk.with_gyro().r;
  Eigen::Matrix<T, 9, 6>& K = root->motion_by_bias;
  K.template block<3, 3>(0, 0).setZero();
  K.template block<3, 3>(0, 3) = by_psi * with_gyro;
  K.template block<3, 3>(3, 0) = -1.0 / root->bias[0] * walk.with_accel().v;
  K.template block<3, 3>(3, 3) = -1.0 / root->bias[3] * walk.with_gyro().v;
  K.template block<3, 3>(6, 0) = -1.0 / root->bias[0] * walk.with_accel().p;
  K.template block<3, 3>(6, 3) = -1.0 / root->bias[3] * walk.with_gyro().p;

  Eigen::Matrix<T, 9, 9>& C = root->motion;
  const Matrix3<T> r_r = by_psi * covariance.rr();
  C.template block<3, 3>(0, 0) = r_r * by_psi.transpose();
  C.template block<3, 3>(0, 3) = by_psi * covariance.vr().transpose();
  C.template block<3, 3>(0, 6) = by_psi * covariance.pr().transpose();
  C.template block<3, 3>(3, 3) = covariance.vv();
  C.template block<3, 3>(3, 6) = covariance.pv().transpose();
  C.template block<3, 3>(6, 6) = covariance.pp();
  // Conditioned on the biases at the end.
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i <= j; ++i) {
      for (int k = i < 3 ? 3 : 0; k < 6; ++k) C(i, j) -= K(i, k) * K(j, k);
    }
  }
  UpperRoot(&C);
}

// U^-1 r.
template <typename T>
Eigen::Matrix<T, 15, 1> Whiten(const NoiseRoot<T>& root,
                               const Eigen::Matrix<T, 15, 1>& residual) {
  Eigen::Matrix<T, 15, 1> white;
  for (int i = 0; i < 6; ++i) white[9 + i] = residual[9 + i] / root.bias[i];
  for (int i = 8; i >= 0; --i) {
    T sum = residual[i];
    for (int k = 0; k < 6; ++k) sum -= root.motion_by_bias(i, k) * white[9 + k];
    for (int k = i + 1; k < 9; ++k) sum -= root.motion(i, k) * white[k];
    white[i] = sum / root.motion(i, i);
  }
  return white;
}

// Rows of the motion in InertialTransition: of G the first 9 by
// TransitionColumns::stride numbers.
template <typename T>
struct MotionRows {
  T G[9 * TransitionColumns(kMaxImuTangentSize).stride];
  T A[9][kTransitionNoise];
};

template <typename T>
class TransitionSolver {
 public:
  TransitionSolver(const Matrix3<T>& R_GI,
                   const StateMotion<T>& motion,
                   T dt,
                   const Eigen::Matrix<T, 15, 1>& residual)
      : R_GI_(R_GI),
        R_01_(motion.q_01.toRotationMatrix()),
        v_(motion.v),
        p_(motion.p),
        dt_(dt),
        residual_(residual) {}

  // `by` is MotionDerivatives or CoupledDerivatives.
  template <class Derivatives>
  void Solve(const Derivatives& by,
             const NoiseRoot<T>& root,
             const TransitionColumns& at,
             MotionRows<T>* rows) const {
    for (int i = 0; i < 9 * at.stride; ++i) rows->G[i] = T(0);
    for (int c = 0; c < at.link_size; ++c) {
      const Eigen::Matrix<T, 9, 1> x = OfMeasured(by.theta.col(c));
      Write(x, c, at.stride, rows->G);
    }
    const Eigen::Matrix<T, 15, 1>& r = residual_;
    Eigen::Matrix<T, 9, 1> constant =
        Carry(R_01_ * r.template segment<3>(kResidualRotation),
              -r.template segment<3>(kResidualVelocity),
              -r.template segment<3>(kResidualPosition));
    const Vector3<T> phi = r.template segment<3>(kResidualRotation);
    const Matrix3<T> turn = -R_01_ * RightJacobian<T>(phi);
    for (int c = 0; c < 6; ++c) {
      const Eigen::Matrix<T, 9, 1> x = OfMeasured(by.bias.col(c));
      Write(x, at.link_size + 3 + c, at.stride, rows->G);
      const Column u = root.motion_by_bias.col(c);
      Write(OfNoise(turn, u) - root.bias[c] * x,
            9 + c,
            kTransitionNoise,
            rows->A[0]);
      constant += r[kResidualAccelBias + c] * x;
    }
    Write(constant, at.constant, at.stride, rows->G);
    WriteNextMotion(at, rows);
    WriteMotionNoise(turn, root, rows);
    for (int i = 0; i < 9; ++i) rows->A[i][kTransitionNoise - 1] = T(0);
  }

  // Rotation, position, velocity.
  using Column = Eigen::Matrix<T, 9, 1>;

  // Change of the state that compensates a derivative of the measured motion
  // (psi, v, p).
  Column OfMeasured(const Eigen::Matrix<T, 9, 1>& derivative) const {
    return Carry(-derivative.template head<3>(),
                 derivative.template segment<3>(3),
                 derivative.template tail<3>());
  }

 private:
  Column Carry(const Vector3<T>& theta,
               const Vector3<T>& y_velocity,
               const Vector3<T>& y_position) const {
    Column x;
    const Vector3<T> velocity = R_GI_ * (v_.cross(theta) - y_velocity);
    x.template segment<3>(kStateRotation) = theta;
    x.template segment<3>(kStateVelocity) = velocity;
    x.template segment<3>(kStatePosition) =
        R_GI_ * (p_.cross(theta) - y_position) - dt_ * velocity;
    return x;
  }

  static void Write(const Column& x, int column, int stride, T* rows) {
    for (int i = 0; i < 9; ++i) rows[i * stride + column] = x[i];
  }

  // Pose and velocity of the next state.
  void WriteNextMotion(const TransitionColumns& at, MotionRows<T>* rows) const {
    const Vector3<T> zero = Vector3<T>::Zero();
    for (int c = 0; c < 3; ++c) {
      Write(Carry(R_01_.col(c), zero, zero),
            at.next_pose + kStateRotation + c,
            at.stride,
            rows->G);
      Column x = Column::Zero();
      x[kStatePosition + c] = T(1);
      Write(x, at.next_pose + kStatePosition + c, at.stride, rows->G);
      x[kStatePosition + c] = -dt_;
      x[kStateVelocity + c] = T(1);
      Write(x, at.link_size + c, at.stride, rows->G);
    }
  }

  // Change of the state that compensates u in the residual of the motion;
  // `turn` transforms its rotation.
  Column OfNoise(const Matrix3<T>& turn, const Column& u) const {
    return Carry(turn * u.template head<3>(),
                 u.template segment<3>(kResidualVelocity),
                 u.template segment<3>(kResidualPosition));
  }

  void WriteMotionNoise(const Matrix3<T>& turn,
                        const NoiseRoot<T>& root,
                        MotionRows<T>* rows) const {
    for (int c = 0; c < 9; ++c) {
      Column u = Column::Zero();
      for (int i = 0; i <= c; ++i) u[i] = root.motion(i, c);
      Write(OfNoise(turn, u), c, kTransitionNoise, rows->A[0]);
    }
  }

  const Matrix3<T> R_GI_, R_01_;
  const Vector3<T> v_, p_;
  const T dt_;
  const Eigen::Matrix<T, 15, 1>& residual_;
};

}  // namespace selfcal::inertial
