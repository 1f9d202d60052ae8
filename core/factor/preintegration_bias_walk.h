// The contribution of the random walk of the biases within an interval to the
// covariance of its preintegrated motion, and the covariance of both at its
// end. Internal to core/factor.
//
// The response of the motion over an interval h to a bias step at the fraction
// u of it is J_i (1 - u)^n_i, where J are the derivatives with respect to a
// constant bias and n is the power of time with which they grow: rotation by
// b_g 1, velocity by b_a 1 and by b_g 2, position by b_a 2 and by b_g 3. That
// is exact at constant rotation and force. A walk of density q^(1/2) then has
//   cov(i, j)          = q h J_i J_j^T / (n_i + n_j + 1)
//   cov(i, end of the walk) = q h J_i / (n_i + 1).
// Intervals are cut into pieces that are short in this sense, and these are
// composed: an error at the end of a piece is propagated like the motion.
#pragma once

#include <Eigen/Core>

#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// State of the integration at some time within an interval.
template <typename T>
struct WalkedInterval {
  T t = T(0);  // [s] since its beginning
  Vector3<T> Delta_v = Vector3<T>::Zero();
  Vector3<T> Delta_p = Vector3<T>::Zero();
  GyroResponse<T> gyro;
  AccelResponse<T> accel;
};

template <typename T>
class BiasWalk {
 public:
  // Densities of the walks of the raw biases.
  BiasWalk(T gyro, T accel) : q_gyro_(gyro * gyro), q_accel_(accel * accel) {}

  // Adds the walk since the last call; the covariance must be propagated to
  // `end`.
  void Advance(const WalkedInterval<T>& end, MotionCovariance<T>* covariance) {
    const T h = end.t - begin_.t;
    const Vector3<T> dv = end.Delta_v - begin_.Delta_v;
    const Vector3<T> dp = end.Delta_p - begin_.Delta_p - h * begin_.Delta_v;
    // Over the piece the errors become (psi, v - dv x psi, p + h v - dp x psi).
    const GyroResponse<T>& g = begin_.gyro;
    const GyroResponse<T> by_gyro = {
        end.gyro.r - g.r,
        end.gyro.v - g.v + Cross<T, 3>(dv, g.r),
        end.gyro.p - g.p - h * g.v + Cross<T, 3>(dp, g.r)};
    const AccelResponse<T> by_accel = {
        end.accel.v - begin_.accel.v,
        end.accel.p - begin_.accel.p - h * begin_.accel.v};
    gyro_.p += h * gyro_.v - Cross<T, 3>(dp, gyro_.r);
    gyro_.v -= Cross<T, 3>(dv, gyro_.r);
    accel_.p += h * accel_.v;
    AddGyro(h, by_gyro, covariance);
    AddAccel(h, by_accel, covariance);
    begin_ = end;
  }

  // Covariances of the motion with the biases at the end of the interval.
  const GyroResponse<T>& with_gyro() const { return gyro_; }
  const AccelResponse<T>& with_accel() const { return accel_; }

 private:
  // H is that of the walk before the piece, which contributes H J^T + J H^T.
  void AddGyro(T h, const GyroResponse<T>& J, MotionCovariance<T>* covariance) {
    const T before = q_gyro_ * begin_.t;
    const T q = q_gyro_ * h;
    const T half = 0.5 * before;
    covariance->AddWalk(
        J,
        {gyro_.r + half * J.r, gyro_.v + half * J.v, gyro_.p + half * J.p},
        q);
    gyro_.r += (before + q * (1.0 / 2)) * J.r;
    gyro_.v += (before + q * (1.0 / 3)) * J.v;
    gyro_.p += (before + q * (1.0 / 4)) * J.p;
  }

  void AddAccel(T h,
                const AccelResponse<T>& J,
                MotionCovariance<T>* covariance) {
    const T before = q_accel_ * begin_.t;
    const T q = q_accel_ * h;
    const T half = 0.5 * before;
    covariance->AddWalk(J, {accel_.v + half * J.v, accel_.p + half * J.p}, q);
    accel_.v += (before + q * (1.0 / 2)) * J.v;
    accel_.p += (before + q * (1.0 / 3)) * J.p;
  }

  const T q_gyro_, q_accel_;
  WalkedInterval<T> begin_;
  GyroResponse<T> gyro_;
  AccelResponse<T> accel_;
};

}  // namespace selfcal::preintegration
