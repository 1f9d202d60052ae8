#include "core/factor/preintegration.h"

#include <algorithm>
#include <cassert>

#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_jacobians.h"
#include "core/factor/preintegration_step.h"
#include "core/model/so3.h"

namespace selfcal {
namespace preintegration {
namespace {

constexpr double kSecondsPerNanosecond = 1e-9;

ImuSample Interpolate(std::span<const ImuSample> samples, std::int64_t t_ns) {
  const auto after = std::upper_bound(
      samples.begin(),
      samples.end(),
      t_ns,
      [](std::int64_t t, const ImuSample& s) { return t < s.t_ns; });
  if (after == samples.begin()) return samples.front();
  const ImuSample& a = *(after - 1);
  if (after == samples.end()) return a;
  const ImuSample& b = *after;
  const double part =
      static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
  return {t_ns,
          a.gyro + part * (b.gyro - a.gyro),
          a.accel + part * (b.accel - a.accel)};
}

// Walks over the steps of the scheme and accumulates. Everything is expressed
// in the body frame of the first keyframe.
class Integrator {
 public:
  Integrator(const ImuCalibration& imu,
             const Vector3d& b_a,
             const Vector3d& b_g,
             const ImuNoise& noise,
             const PreintegrationParts& parts)
      : parts_(parts),
        noise_(noise),
        b_a_(b_a),
        b_g_(b_g),
        T_g_inverse_(imu.T_g().inverse()),
        T_a_inverse_(imu.T_a().inverse()),
        R_IA_(imu.q_AI.toRotationMatrix().transpose()),
        accel_correction_(R_IA_ * T_a_inverse_) {}

  Reading Correct(const ImuSample& sample) const {
    const Vector3d h_A = T_a_inverse_ * (sample.accel - b_a_);
    return {T_g_inverse_ * (sample.gyro - b_g_), h_A, R_IA_ * h_A};
  }

  void Step(const Reading& r0, const Reading& r1, double h);
  Preintegration Result(double dt_s) const;

 private:
  void Propagate(const Stage& s,
                 const Reading& r0,
                 const Reading& r1,
                 const Vector3d& phi_m,
                 const Vector3d& phi_1);

  const PreintegrationParts parts_;
  const ImuNoise noise_;
  const Vector3d b_a_, b_g_;
  const Matrix3d T_g_inverse_, T_a_inverse_, R_IA_, accel_correction_;

  Eigen::Quaterniond Delta_R_ = Eigen::Quaterniond::Identity();
  Matrix3d R_ = Matrix3d::Identity();
  Vector3d Delta_v_ = Vector3d::Zero(), Delta_p_ = Vector3d::Zero();
  MotionJacobians jacobians_;
  MotionCovariance covariance_;
};

void Integrator::Step(const Reading& r0, const Reading& r1, double h) {
  const Vector3d coning = h * h / 12 * r0.w.cross(r1.w);
  const Vector3d phi_m = h / 8 * (3 * r0.w + r1.w) + coning / 8;
  const Vector3d phi_1 = h / 2 * (r0.w + r1.w) + coning;
  Stage s;
  s.h = h;
  s.R_0 = R_;
  s.R_m = R_ * Exp(phi_m).toRotationMatrix();
  Delta_R_ = (Delta_R_ * Exp(phi_1)).normalized();
  R_ = Delta_R_.toRotationMatrix();
  s.R_1 = R_;
  s.f_0 = s.R_0 * r0.f;
  s.f_m = s.R_m * (0.5 * (r0.f + r1.f));
  s.f_1 = s.R_1 * r1.f;
  s.dv = h / 6 * (s.f_0 + 4 * s.f_m + s.f_1);
  s.dp = h * h / 6 * (s.f_0 + 2 * s.f_m);

  if (parts_.jacobians || parts_.covariance) {
    Propagate(s, r0, r1, phi_m, phi_1);
  }
  Delta_p_ += h * Delta_v_ + s.dp;
  Delta_v_ += s.dv;
}

void Integrator::Propagate(const Stage& s,
                           const Reading& r0,
                           const Reading& r1,
                           const Vector3d& phi_m,
                           const Vector3d& phi_1) {
  const double h = s.h;
  const double coning = h * h / 12;
  const auto turn_of = [&](const Vector3d& phi, double a, double b, double c) {
    return TurnOf(s.R_0, phi, r0.w, r1.w, a, b, c, T_g_inverse_);
  };
  const Turn turn_m = turn_of(phi_m, 3 * h / 8, h / 8, coning / 8);
  const Turn turn_1 = turn_of(phi_1, h / 2, h / 2, coning);
  if (parts_.jacobians) {
    jacobians_.AddGyro(s,
                       ByGyroParameters(turn_m, r0.w, r1.w),
                       ByGyroParameters(turn_1, r0.w, r1.w));
    jacobians_.AddAccel(s, r0, r1);
  }
  if (parts_.covariance) {
    covariance_.Propagate(s);
    covariance_.AddGyroNoise(
        s, turn_m.by_both(), turn_1.by_both(), noise_.gyro_noise_density);
    covariance_.AddAccelNoise(s, accel_correction_, noise_.accel_noise_density);
  }
}

Preintegration Integrator::Result(double dt_s) const {
  Preintegration result;
  result.dt_s = dt_s;
  result.Delta_R = Delta_R_;
  result.Delta_v = Delta_v_;
  result.Delta_p = Delta_p_;
  if (parts_.jacobians) {
    jacobians_.Write(R_, R_IA_, accel_correction_, &result);
  }
  if (parts_.covariance) result.covariance = covariance_.Result(R_);
  return result;
}

}  // namespace
}  // namespace preintegration

Preintegration Preintegrate(std::span<const ImuSample> samples,
                            std::int64_t t0_ns,
                            std::int64_t t1_ns,
                            const ImuCalibration& imu,
                            const Eigen::Vector3d& b_a,
                            const Eigen::Vector3d& b_g,
                            const ImuNoise& noise,
                            const PreintegrationParts& parts) {
  using namespace preintegration;
  assert(!samples.empty() && t0_ns <= t1_ns);
  Integrator integrator(imu, b_a, b_g, noise, parts);
  Reading previous = integrator.Correct(Interpolate(samples, t0_ns));
  std::int64_t t_ns = t0_ns;
  const auto advance = [&](std::int64_t next_ns, const ImuSample& sample) {
    const Reading next = integrator.Correct(sample);
    integrator.Step(
        previous,
        next,
        static_cast<double>(next_ns - t_ns) * kSecondsPerNanosecond);
    previous = next;
    t_ns = next_ns;
  };
  // Only samples strictly inside: no step has length zero.
  auto it = std::upper_bound(
      samples.begin(),
      samples.end(),
      t0_ns,
      [](std::int64_t t, const ImuSample& s) { return t < s.t_ns; });
  for (; it != samples.end() && it->t_ns < t1_ns; ++it) advance(it->t_ns, *it);
  if (t1_ns > t_ns) advance(t1_ns, Interpolate(samples, t1_ns));
  return integrator.Result(static_cast<double>(t1_ns - t0_ns) *
                           kSecondsPerNanosecond);
}

}  // namespace selfcal
