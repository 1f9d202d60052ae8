// Integrates over the steps of the scheme of preintegration.h and accumulates
// the motion, its derivatives and its covariance. Internal to core/factor.
//
// T is double, or Lanes for several intervals at once. Everything is expressed
// in the body frame of the first keyframe, with rotations perturbed on their
// left.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <type_traits>

#include "core/factor/coupled_derivatives.h"
#include "core/factor/preintegration.h"
#include "core/factor/preintegration_bias_walk.h"
#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_jacobians.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// The motion, with the members of Preintegration.
template <typename T>
struct Motion {
  Eigen::Quaternion<T> Delta_R{T(1), T(0), T(0), T(0)};
  Vector3<T> Delta_v = Vector3<T>::Zero();
  Vector3<T> Delta_p = Vector3<T>::Zero();
};

// Number of steps in a piece of the bias walk.
inline constexpr int kWalkSteps = 24;

// Imu is ImuModel or CoupledImuModel.
template <typename T, class Imu>
class Integrator {
 public:
  // Starts at a reading.
  Integrator(const Imu& imu,
             const ImuNoise& noise,
             const PreintegrationParts& parts,
             const Reading<T>& first)
      : parts_(parts),
        imu_(imu),
        force_by_accel_(imu.ForceByAccel()),
        reading_(first),
        f_(first.f),
        walk_(noise.gyro_bias_random_walk, noise.accel_bias_random_walk) {}

  // Advances to the next reading, h [s] later, with the noise densities of the
  // step.
  SELFCAL_FLATTEN void Step(const Reading<T>& next,
                            T h,
                            T gyro_density = T(0),
                            T accel_density = T(0)) {
    const T h2 = h * h;
    const Turn<T> turn_m(
        h * (3.0 / 8), h * (1.0 / 8), h2 * (1.0 / 96), reading_, next);
    const Turn<T> turn_1(
        h * (1.0 / 2), h * (1.0 / 2), h2 * (1.0 / 12), reading_, next);
    Stage<T> s;
    s.h = h;
    s.R_0 = R_;
    const Matrix3<T> A_m = turn_m.LeftJacobian(R_);
    // Exp(phi) = I + J_l(phi) [phi]x.
    s.R_m = R_ + TimesSkew<T>(A_m, turn_m.phi);
    Rotate(turn_1.phi);
    s.R_1 = R_;
    const auto forces = SetForces(next, &s);
    s.dv = h * (1.0 / 6) * (s.f_0 + 4.0 * s.f_m + s.f_1);
    s.dp = h2 * (1.0 / 6) * (s.f_0 + 2.0 * s.f_m);

    if (parts_.jacobians || parts_.covariance) {
      Propagate(
          s, turn_m, A_m, turn_1, next, forces, gyro_density, accel_density);
    }
    motion_.Delta_p += h * motion_.Delta_v + s.dp;
    motion_.Delta_v += s.dv;
    reading_ = next;
    f_ = s.f_1;
    t_ += h;
    if (parts_.covariance && ++steps_ % kWalkSteps == 0) AdvanceWalk();
  }

  // Must be called after the last step if a covariance is needed.
  void Finish() {
    if (steps_ % kWalkSteps != 0) AdvanceWalk();
  }

  const Motion<T>& motion() const { return motion_; }
  const Matrix3<T>& Delta_R() const { return R_; }
  auto Derivatives() const {
    return jacobians_.Derivatives(imu_, force_by_accel_);
  }
  const MotionCovariance<T>& covariance() const { return covariance_; }
  const BiasWalk<T>& walk() const { return walk_; }

 private:
  static constexpr bool kCoupled = std::is_same_v<Imu, CoupledImuModel<T>>;
  struct NoForces {};
  using Jacobians =
      std::conditional_t<kCoupled, CoupledJacobians<T>, MotionJacobians<T>>;
  using Forces = std::conditional_t<kCoupled, StepForces<T>, NoForces>;

  // The forces of a step to `next` with known rotations. That at the end of a
  // step is that at the beginning of the next, unless it depends on dw/dt.
  Forces SetForces(const Reading<T>& next, Stage<T>* s) const {
    if constexpr (kCoupled) {
      const Forces forces(imu_, reading_, next, s->h);
      s->f_0 = s->R_0 * forces.begin.f;
      s->f_m = s->R_m * forces.middle.f;
      s->f_1 = s->R_1 * forces.end.f;
      return forces;
    } else {
      s->f_0 = f_;
      s->f_m = s->R_m * (0.5 * (reading_.f + next.f));
      s->f_1 = s->R_1 * next.f;
      return {};
    }
  }

  [[gnu::noinline]] void AdvanceWalk() {
    walk_.Advance({t_,
                   motion_.Delta_v,
                   motion_.Delta_p,
                   jacobians_.ByGyro(imu_.T_g_inverse),
                   jacobians_.ByAccel(force_by_accel_)},
                  &covariance_);
  }

  // The norm stays one to rounding: an error e of the norm becomes 3/8 e^2.
  void Rotate(const Vector3<T>& phi) {
    Eigen::Quaternion<T>& q = motion_.Delta_R;
    q = q * Exp(phi);
    q.coeffs() *= 1.5 - 0.5 * q.coeffs().squaredNorm();
    R_ = q.toRotationMatrix();
  }

  void Propagate(const Stage<T>& s,
                 const Turn<T>& turn_m,
                 const Matrix3<T>& A_m,
                 const Turn<T>& turn_1,
                 const Reading<T>& next,
                 const Forces& forces,
                 T gyro_density,
                 T accel_density) {
    const ForceResponse<T> force = RespondToForce(s);
    // The walk of the biases also needs derivatives.
    if constexpr (kCoupled) {
      const CoupledRateResponse<T> rates = RespondToCoupledRates(
          s, turn_m, A_m, turn_1, reading_, next, forces, imu_);
      jacobians_.Add(s, rates, force, forces, imu_);
      AddNoise(s, rates, force, gyro_density, accel_density);
    } else {
      const RateResponse<T> rates = RespondToRates(s, turn_m, A_m, turn_1);
      jacobians_.AddGyro(s, rates);
      jacobians_.AddAccel(s, force, reading_, next);
      AddNoise(s, rates, force, gyro_density, accel_density);
    }
  }

  template <class Response>
  void AddNoise(const Stage<T>& s,
                const Response& rates,
                const ForceResponse<T>& force,
                T gyro_density,
                T accel_density) {
    if (parts_.covariance) {
      covariance_.Propagate(s);
      covariance_.AddGyroNoise(s, rates, imu_.T_g_inverse, gyro_density);
      covariance_.AddAccelNoise(s, force, force_by_accel_, accel_density);
    }
  }

  const PreintegrationParts parts_;
  const Imu imu_;
  const Matrix3<T> force_by_accel_;

  Reading<T> reading_;  // at the end of the last step
  Vector3<T> f_;        // its force, in the frame of the first keyframe
  Motion<T> motion_;
  Matrix3<T> R_ = Matrix3<T>::Identity();
  Jacobians jacobians_;
  MotionCovariance<T> covariance_;
  int steps_ = 0;
  T t_ = T(0);  // since the beginning of the interval
  BiasWalk<T> walk_;
};

}  // namespace selfcal::preintegration
