#include "core/factor/preintegration.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
// Derivatives of a rotation by (b_g 3, s_g 3, m_g 3).
using GyroJacobian = Eigen::Matrix<double, 3, 9>;

constexpr double kSecondsPerNanosecond = 1e-9;

// One raw reading, corrected. The specific force stays in A (h = T_a^-1 (a~ -
// b_a)): the fixed rotation into I is applied where it is needed.
struct Reading {
  Vector3d w;
  Vector3d h_A;
};

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

// Derivative of a corrected vector T^-1 (x~ - b) = y by (b 3, s 3, m 3), where
// T is upper triangular with s on the diagonal and m above it: -T^-1 times
// (I, dT/ds y, dT/dm y).
GyroJacobian CorrectionJacobian(const Matrix3d& T_inverse, const Vector3d& y) {
  GyroJacobian J;
  J.leftCols<3>() = -T_inverse;
  J.col(3) = -T_inverse.col(0) * y.x();
  J.col(4) = -T_inverse.col(1) * y.y();
  J.col(5) = -T_inverse.col(2) * y.z();
  J.col(6) = -T_inverse.col(0) * y.y();
  J.col(7) = -T_inverse.col(0) * y.z();
  J.col(8) = -T_inverse.col(1) * y.z();
  return J;
}

// [v]x J.
GyroJacobian Cross(const Vector3d& v, const GyroJacobian& J) {
  return Skew(v) * J;
}

// Walks over the steps of the scheme and accumulates. Everything is expressed
// in the body frame of the first keyframe; a rotation error psi is on the left,
// Exp(psi) Delta_R, and turned to the right at the end.
class Integrator {
 public:
  Integrator(const ImuCalibration& imu,
             const Vector3d& b_a,
             const Vector3d& b_g,
             const ImuNoise& noise,
             const PreintegrationParts& parts)
      : parts_(parts),
        b_a_(b_a),
        b_g_(b_g),
        T_g_inverse_(imu.T_g().inverse()),
        T_a_inverse_(imu.T_a().inverse()),
        R_IA_(imu.q_AI.toRotationMatrix().transpose()),
        R_IA_T_a_inverse_(R_IA_ * T_a_inverse_),
        gyro_variance_(noise.gyro_noise_density * noise.gyro_noise_density),
        accel_variance_(noise.accel_noise_density * noise.accel_noise_density) {
  }

  Reading Correct(const ImuSample& sample) const {
    return {T_g_inverse_ * (sample.gyro - b_g_),
            T_a_inverse_ * (sample.accel - b_a_)};
  }

  void Step(const Reading& r0, const Reading& r1, double h);
  Preintegration Result(double dt_s) const;

 private:
  // One step: rotations at its beginning, middle and end (body there to the
  // first keyframe), rotation vectors to the middle and the end, and the
  // specific force at the three, in the frame of the first keyframe.
  struct Stage {
    double h;
    Vector3d phi_m, phi_1;
    Matrix3d R_0, R_m, R_1;
    Vector3d f_0, f_m, f_1;
    // Integral and double integral of the force over the step.
    Vector3d dv() const { return h / 6 * (f_0 + 4 * f_m + f_1); }
    Vector3d dp() const { return h * h / 6 * (f_0 + 2 * f_m); }
  };

  void AccumulateGyro(const Reading& r0, const Reading& r1, const Stage& s);
  void AccumulateAccel(const Reading& r0, const Reading& r1, const Stage& s);
  void AccumulateCovariance(const Vector3d& w0,
                            const Vector3d& w1,
                            const Stage& s);

  const PreintegrationParts parts_;
  const Vector3d b_a_, b_g_;
  const Matrix3d T_g_inverse_, T_a_inverse_, R_IA_, R_IA_T_a_inverse_;
  const double gyro_variance_, accel_variance_;

  Quaterniond Delta_R_ = Quaterniond::Identity();
  Matrix3d R_ = Matrix3d::Identity();
  Vector3d Delta_v_ = Vector3d::Zero(), Delta_p_ = Vector3d::Zero();

  // By (b_g, s_g, m_g).
  GyroJacobian psi_ = GyroJacobian::Zero();
  GyroJacobian v_gyro_ = GyroJacobian::Zero();
  GyroJacobian p_gyro_ = GyroJacobian::Zero();

  // Integral and double integral of R h_k, for h_k in (1, h_A). A derivative of
  // f is a fixed matrix times one of these factors, so these eight matrices
  // carry the derivatives by all accelerometer parameters.
  std::array<Matrix3d, 4> v_accel_ = {
      Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()};
  std::array<Matrix3d, 4> p_accel_ = v_accel_;

  // Of (psi, Delta_v, Delta_p).
  Eigen::Matrix<double, 9, 9> covariance_ = Eigen::Matrix<double, 9, 9>::Zero();
};

// Derivatives of the rotation vectors over half a step (m) and over the step
// (e) by the rates at its ends.
struct MagnusJacobian {
  Matrix3d m_0, m_1;  // of phi_m, by w_0 and w_1
  Matrix3d e_0, e_1;  // of phi_1
  MagnusJacobian(const Vector3d& w0, const Vector3d& w1, double h) {
    const Matrix3d I = Matrix3d::Identity();
    const Matrix3d c_0 = h * h / 12 * Skew(w0);
    const Matrix3d c_1 = h * h / 12 * Skew(w1);
    m_0 = 3 * h / 8 * I - c_1 / 8;
    m_1 = h / 8 * I + c_0 / 8;
    e_0 = h / 2 * I - c_1;
    e_1 = h / 2 * I + c_0;
  }
};

void Integrator::Step(const Reading& r0, const Reading& r1, double h) {
  Stage s;
  s.h = h;
  const Vector3d coning = h * h / 12 * r0.w.cross(r1.w);
  s.phi_m = h / 8 * (3 * r0.w + r1.w) + coning / 8;
  s.phi_1 = h / 2 * (r0.w + r1.w) + coning;
  s.R_0 = R_;
  s.R_m = R_ * Exp(s.phi_m).toRotationMatrix();
  Delta_R_ = (Delta_R_ * Exp(s.phi_1)).normalized();
  R_ = Delta_R_.toRotationMatrix();
  s.R_1 = R_;
  s.f_0 = s.R_0 * (R_IA_ * r0.h_A);
  s.f_m = s.R_m * (R_IA_ * (0.5 * (r0.h_A + r1.h_A)));
  s.f_1 = s.R_1 * (R_IA_ * r1.h_A);

  if (parts_.covariance) AccumulateCovariance(r0.w, r1.w, s);
  if (parts_.jacobians) {
    AccumulateGyro(r0, r1, s);
    AccumulateAccel(r0, r1, s);
  }
  Delta_p_ += h * Delta_v_ + s.dp();
  Delta_v_ += s.dv();
}

void Integrator::AccumulateGyro(const Reading& r0,
                                const Reading& r1,
                                const Stage& s) {
  const GyroJacobian w0 = CorrectionJacobian(T_g_inverse_, r0.w);
  const GyroJacobian w1 = CorrectionJacobian(T_g_inverse_, r1.w);
  const MagnusJacobian magnus(r0.w, r1.w, s.h);
  // Exp(phi + d) = Exp(J_l(phi) d) Exp(phi), and J_l(phi) = J_r(-phi).
  const GyroJacobian psi_0 = psi_;
  const GyroJacobian psi_m = psi_0 + (s.R_0 * RightJacobian(-s.phi_m)) *
                                         (magnus.m_0 * w0 + magnus.m_1 * w1);
  psi_ = psi_0 + (s.R_0 * RightJacobian(-s.phi_1)) *
                     (magnus.e_0 * w0 + magnus.e_1 * w1);
  // A force turns with its rotation: d f = psi x f.
  const GyroJacobian f_0 = Cross(s.f_0, psi_0);
  const GyroJacobian f_m = Cross(s.f_m, psi_m);
  const GyroJacobian f_1 = Cross(s.f_1, psi_);
  p_gyro_ += s.h * v_gyro_ - s.h * s.h / 6 * (f_0 + 2 * f_m);
  v_gyro_ -= s.h / 6 * (f_0 + 4 * f_m + f_1);
}

void Integrator::AccumulateAccel(const Reading& r0,
                                 const Reading& r1,
                                 const Stage& s) {
  for (int k = 0; k < 4; ++k) {
    const double h_0 = k == 0 ? 1 : r0.h_A[k - 1];
    const double h_1 = k == 0 ? 1 : r1.h_A[k - 1];
    const Matrix3d a_0 = h_0 * s.R_0;
    const Matrix3d a_m = (h_0 + h_1) * s.R_m;  // twice the mean
    p_accel_[k] += s.h * v_accel_[k] + s.h * s.h / 6 * (a_0 + a_m);
    v_accel_[k] += s.h / 6 * (a_0 + 2 * a_m + h_1 * s.R_1);
  }
}

void Integrator::AccumulateCovariance(const Vector3d& w0,
                                      const Vector3d& w1,
                                      const Stage& s) {
  // Transition (psi, v, p) -> (psi, v - [dv]x psi, p + h v - [dp]x psi), in
  // place: first the rows, then the columns, p before v as it needs the old v.
  const Matrix3d dv = Skew(s.dv());
  const Matrix3d dp = Skew(s.dp());
  auto& P = covariance_;
  P.middleRows<3>(6) += s.h * P.middleRows<3>(3) - dp * P.middleRows<3>(0);
  P.middleRows<3>(3) -= dv * P.middleRows<3>(0);
  P.middleCols<3>(6) +=
      s.h * P.middleCols<3>(3) + P.middleCols<3>(0) * dp;  // [x]^T = -[x]
  P.middleCols<3>(3) += P.middleCols<3>(0) * dv;

  // Noise that is constant over the step, on the raw reading.
  const MagnusJacobian magnus(w0, w1, s.h);
  const Matrix3d psi_m = s.R_0 * RightJacobian(-s.phi_m) *
                         (magnus.m_0 + magnus.m_1) * T_g_inverse_;
  Eigen::Matrix<double, 9, 3> gyro;
  gyro.topRows<3>() = s.R_0 * RightJacobian(-s.phi_1) *
                      (magnus.e_0 + magnus.e_1) * T_g_inverse_;
  const Matrix3d f_m = Skew(s.f_m) * psi_m;
  gyro.middleRows<3>(3) =
      -s.h / 6 * (4 * f_m + Skew(s.f_1) * gyro.topRows<3>());
  gyro.bottomRows<3>() = -s.h * s.h / 3 * f_m;
  P += (gyro_variance_ / s.h) * gyro * gyro.transpose();

  Eigen::Matrix<double, 6, 3> accel;
  const double h = s.h;
  accel.topRows<3>() = h / 6 * (s.R_0 + 4 * s.R_m + s.R_1) * R_IA_T_a_inverse_;
  accel.bottomRows<3>() = h * h / 6 * (s.R_0 + 2 * s.R_m) * R_IA_T_a_inverse_;
  P.bottomRightCorner<6, 6>() +=
      (accel_variance_ / h) * accel * accel.transpose();
  // White noise is not constant over the step: about its mean it moves the
  // position by h^3 / 12 more. Without that, one step alone would tie velocity
  // and position together and leave the covariance singular.
  const Matrix3d A = s.R_m * R_IA_T_a_inverse_;
  P.bottomRightCorner<3, 3>() +=
      (accel_variance_ * h * h * h / 12) * A * A.transpose();
}

Preintegration Integrator::Result(double dt_s) const {
  Preintegration result;
  result.dt_s = dt_s;
  result.Delta_R = Delta_R_;
  result.Delta_v = Delta_v_;
  result.Delta_p = Delta_p_;
  const Matrix3d R_transpose = R_.transpose();
  if (parts_.covariance) {
    result.covariance = covariance_;
    result.covariance.topRows<3>() =
        (R_transpose * result.covariance.topRows<3>()).eval();
    result.covariance.leftCols<3>() =
        (result.covariance.leftCols<3>() * R_).eval();
  }
  if (!parts_.jacobians) return result;

  Eigen::Matrix<double, 9, 9> gyro;
  gyro << R_transpose * psi_, v_gyro_, p_gyro_;
  result.J_bias.rightCols<3>() = gyro.leftCols<3>();
  result.J_theta.middleCols<6>(kGyroScale) = gyro.rightCols<6>();

  const Matrix3d& B = R_IA_T_a_inverse_;
  for (int row : {3, 6}) {
    const auto& M = row == 3 ? v_accel_ : p_accel_;
    result.J_bias.block<3, 3>(row, 0) = -M[0] * B;
    auto theta = result.J_theta.middleRows<3>(row);
    theta.col(kAccelScale + 0) = -M[1] * B.col(0);
    theta.col(kAccelScale + 1) = -M[2] * B.col(1);
    theta.col(kAccelScale + 2) = -M[3] * B.col(2);
    theta.col(kAccelMisalignment + 0) = -M[2] * B.col(0);
    theta.col(kAccelMisalignment + 1) = -M[3] * B.col(0);
    theta.col(kAccelMisalignment + 2) = -M[3] * B.col(1);
    // (R_AI Exp(d))^T h = f + [f]x d.
    theta.middleCols<3>(kAccelRotation) = M[1] * Skew(R_IA_.col(0)) +
                                          M[2] * Skew(R_IA_.col(1)) +
                                          M[3] * Skew(R_IA_.col(2));
  }
  return result;
}

}  // namespace

Preintegration Preintegrate(std::span<const ImuSample> samples,
                            std::int64_t t0_ns,
                            std::int64_t t1_ns,
                            const ImuCalibration& imu,
                            const Eigen::Vector3d& b_a,
                            const Eigen::Vector3d& b_g,
                            const ImuNoise& noise,
                            const PreintegrationParts& parts) {
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
