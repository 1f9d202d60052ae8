// The inertial residual as templates over the scalar, for one link or for
// several at once. Internal to core/factor.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/factor/preintegration_step.h"
#include "core/model/so3_lanes.h"

namespace selfcal {

// Offsets in the residual; the first three as in Preintegration.
constexpr int kResidualRotation = 0;
constexpr int kResidualVelocity = 3;
constexpr int kResidualPosition = 6;
constexpr int kResidualAccelBias = 9;
constexpr int kResidualGyroBias = 12;

// The motion between two states, in the body frame of the first, without
// gravity.
template <typename T>
struct StateMotion {
  Eigen::Quaternion<T> q_01;
  Eigen::Matrix<T, 3, 1> v;
  Eigen::Matrix<T, 3, 1> p;
};

// State has the members of KeyframeState, with scalars of type T.
template <typename T, class State>
StateMotion<T> MotionBetween(const State& x0,
                             const State& x1,
                             T dt,
                             T gravity_mps2) {
  const Eigen::Matrix<T, 3, 1> g(T(0), T(0), -gravity_mps2);
  const Eigen::Quaternion<T> q_IG = x0.q_GI.conjugate();
  const Eigen::Matrix<T, 3, 1> v = x1.v_GI - x0.v_GI - dt * g;
  const Eigen::Matrix<T, 3, 1> p =
      x1.p_GI - x0.p_GI - dt * x0.v_GI - 0.5 * dt * dt * g;
  return {q_IG * x1.q_GI, q_IG * v, q_IG * p};
}

// Measured has the members Delta_R, Delta_v and Delta_p of Preintegration.
template <typename T, class State, class Measured>
Eigen::Matrix<T, 15, 1> ResidualOf(const State& x0,
                                   const State& x1,
                                   const StateMotion<T>& motion,
                                   const Measured& measured) {
  const Eigen::Quaternion<T> error = measured.Delta_R.conjugate() * motion.q_01;
  Eigen::Matrix<T, 15, 1> residual;
  residual.template segment<3>(kResidualRotation) = Log(error);
  residual.template segment<3>(kResidualVelocity) = motion.v - measured.Delta_v;
  residual.template segment<3>(kResidualPosition) = motion.p - measured.Delta_p;
  residual.template segment<3>(kResidualAccelBias) = x1.b_a - x0.b_a;
  residual.template segment<3>(kResidualGyroBias) = x1.b_g - x0.b_g;
  return residual;
}

}  // namespace selfcal
