#include "core/model/second_imu.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/model/imu_model.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

Eigen::Vector3d PositionInBody(const SecondImuCalibration& imu) {
  return -(imu.q_JI.conjugate() * imu.p_JI);
}

std::int64_t OffsetNs(const SecondImuCalibration& imu) {
  return std::llround(1e9 * imu.time_offset_s);
}

// Rate and specific force of the body by the readings of the first IMU.
struct MeasuredMotion {
  Eigen::Vector3d w_I;
  Eigen::Vector3d f_I;
};

// Interpolates between the samples about t_ns; beyond them, the nearest holds.
MeasuredMotion MotionAt(const CoupledImuModel<double>& model,
                        std::span<const ImuSample> samples,
                        const KeyframeState& x,
                        std::int64_t t_ns) {
  const auto after = std::lower_bound(
      samples.begin(),
      samples.end(),
      t_ns,
      [](const ImuSample& s, std::int64_t t) { return s.t_ns < t; });
  const auto b = after == samples.end() ? after - 1 : after;
  const auto a = b == samples.begin() ? b : b - 1;
  const auto step = static_cast<double>(b->t_ns - a->t_ns);
  const double u =
      step > 0 ? std::clamp(static_cast<double>(t_ns - a->t_ns) / step, 0., 1.)
               : 0;
  const auto reading = model.Correct(a->gyro + u * (b->gyro - a->gyro),
                                     a->accel + u * (b->accel - a->accel),
                                     x.b_g,
                                     x.b_a);
  return {reading.w, reading.f};
}

}  // namespace

const ImuCalibration& ImuOf(const Calibration& theta, int imu) {
  return imu == 0 ? theta.imu : *theta.imu1;
}

const ImuNoise& NoiseOfImu(const Rig& rig, int imu) {
  return imu == 0 ? rig.imu_noise : rig.imu1_noise;
}

KeyframeState StateOfImu(const Calibration& theta,
                         int imu,
                         const KeyframeState& x) {
  if (imu == 0) return x;
  const SecondImuCalibration& mount = *theta.imu1;
  return {.t_ns = x.t_ns - OffsetNs(mount),
          .q_GI = (x.q_GI * mount.q_JI.conjugate()).normalized(),
          .p_GI = x.p_GI + x.q_GI * PositionInBody(mount),
          .v_GI = x.v_GJ,
          .b_a = x.b_a1,
          .b_g = x.b_g1};
}

// Right perturbations a of R_GI and c of R_JI give
//   R_GI Exp(a) Exp(-c) R_JI^T = R_GJ Exp(R_JI (a - c)),
//   R_GI Exp(a) Exp(-c) p_IJ = R_GI (p_IJ + (a - c) x p_IJ),
// to first order.
MountDerivatives DerivativesOfMount(const SecondImuCalibration& imu,
                                    const KeyframeState& x) {
  const Eigen::Matrix3d R_GI = x.q_GI.toRotationMatrix();
  const Eigen::Matrix3d R_JI = imu.q_JI.toRotationMatrix();
  const Eigen::Matrix3d by_turn = -R_GI * Skew(PositionInBody(imu));
  MountDerivatives by;
  by.by_pose << R_JI, Eigen::Matrix3d::Zero(), by_turn,
      Eigen::Matrix3d::Identity();
  by.by_mount << -R_JI, Eigen::Matrix3d::Zero(), -by_turn,
      -R_GI * R_JI.transpose();
  return by;
}

void StartSecondImu(const Calibration& theta_s, MotionSegment* segment) {
  if (!theta_s.imu1) return;
  const SecondImuCalibration& imu = *theta_s.imu1;
  const Eigen::Matrix3d R_JI = imu.q_JI.toRotationMatrix();
  const Eigen::Vector3d p_IJ = PositionInBody(imu);
  const CoupledImuModel<double> first(CorrectionOf(theta_s.imu));
  const ImuResponse second(imu);
  std::vector<KeyframeState>& keyframes = segment->keyframes;
  const auto motion_at = [&](const KeyframeState& x, std::int64_t t_ns) {
    return MotionAt(first, segment->imu, x, t_ns);
  };
  for (KeyframeState& x : keyframes) {
    x.v_GJ = x.v_GI + x.q_GI * motion_at(x, x.t_ns).w_I.cross(p_IJ);
  }
  // The mean of the angular acceleration is the difference of rates.
  const KeyframeState& begin = keyframes.front();
  const KeyframeState& end = keyframes.back();
  const double dt_s = 1e-9 * static_cast<double>(end.t_ns - begin.t_ns);
  const Eigen::Vector3d dw_I =
      (motion_at(end, end.t_ns).w_I - motion_at(begin, begin.t_ns).w_I) / dt_s;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  int count = 0;
  for (const ImuSample& sample : SecondSamplesFromFirstKeyframe(*segment)) {
    const std::int64_t t_ns = sample.t_ns + OffsetNs(imu);
    if (t_ns < begin.t_ns) continue;
    if (t_ns > end.t_ns) break;
    const MeasuredMotion motion = motion_at(begin, t_ns);
    const Eigen::Vector3d w_J = R_JI * motion.w_I;
    const Eigen::Vector3d f_J =
        R_JI * (motion.f_I + ForceByPosition<double>(motion.w_I, dw_I) * p_IJ);
    const Eigen::Vector3d f_A = second.ForceRead(w_J, R_JI * dw_I, f_J);
    gyro += sample.gyro - second.Gyro(w_J, f_A);
    accel += sample.accel - second.Accel(f_A);
    ++count;
  }
  for (KeyframeState& x : keyframes) {
    x.b_g1 = gyro / std::max(count, 1);
    x.b_a1 = accel / std::max(count, 1);
  }
}

StartedSegment::StartedSegment(const Calibration& theta_s,
                               const MotionSegment& segment)
    : given_(segment) {
  if (!theta_s.imu1) return;
  started_ = segment;
  StartSecondImu(theta_s, &*started_);
}

}  // namespace selfcal
