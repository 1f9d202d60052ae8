// Random arguments of factors, from a seed: any attitude, calibrations away
// from nominal, IMU readings without any smoothness.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "core/factor/keyframe_motion.h"
#include "core/model/calibration.h"
#include "core/model/camera_model.h"
#include "core/model/segment.h"
#include "core/model/so3.h"

namespace selfcal {

class RandomValues {
 public:
  explicit RandomValues(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double LogUniform(double low, double high) {
    return std::exp(Uniform(std::log(low), std::log(high)));
  }
  int Index(int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(engine_);
  }
  double Normal() { return normal_(engine_); }
  Eigen::VectorXd NormalVector(int n) {
    return Eigen::VectorXd::NullaryExpr(n, [this] { return Normal(); });
  }
  Eigen::Vector3d Normal3(double sigma) { return sigma * NormalVector(3); }

  // Uniform over all rotations.
  Eigen::Quaterniond Rotation() {
    return Eigen::Quaterniond(Eigen::Vector4d(NormalVector(4).normalized()));
  }

  ImuCalibration Imu() {
    ImuCalibration imu;
    imu.s_g += Normal3(0.05);
    imu.m_g = Normal3(0.05);
    imu.s_a += Normal3(0.05);
    imu.m_a = Normal3(0.05);
    imu.q_AI = Rotation();
    return imu;
  }

  // An IMU with any of the optional blocks, at least one.
  ImuCalibration CoupledImu() {
    constexpr int kPositions[] = {0, 3, 9, 3, 9};
    const int kind = Index(5);
    ImuCalibration imu = Imu();
    if (kind == 0 || kind > 2) imu.gyro_g_sensitivity = 5e-3 * NormalVector(9);
    imu.accel_position = 0.05 * NormalVector(kPositions[kind]);
    return imu;
  }

  SecondImuCalibration SecondImu(bool coupled) {
    SecondImuCalibration imu;
    static_cast<ImuCalibration&>(imu) = coupled ? CoupledImu() : Imu();
    imu.q_JI = Rotation();
    imu.p_JI = Normal3(0.1);
    return imu;
  }

  CameraCalibration Camera(DistortionModel model) {
    CameraCalibration camera;
    camera.q_CI = Rotation();
    camera.p_CI = Normal3(0.1);
    const Eigen::Vector2d px_per_rad(Uniform(200, 500), Uniform(200, 500));
    camera.c = {Uniform(300, 340), Uniform(220, 260)};
    camera.width_px = 640;
    camera.height_px = 480;
    camera.model = model;
    switch (model) {
      case DistortionModel::kFov:
        camera.distortion.setConstant(1, Uniform(0.5, 1.0));
        break;
      case DistortionModel::kRadialTangential:
        camera.distortion.resize(4);
        camera.distortion << Uniform(-0.3, -0.2), Uniform(0.05, 0.1),
            Uniform(-1e-3, 1e-3), Uniform(-1e-3, 1e-3);
        break;
      case DistortionModel::kEquidistant:
        camera.distortion = 0.01 * NormalVector(4);
        break;
      default:
        camera.distortion = Undistorted(model);
        for (int i = 0; i < camera.distortion.size(); ++i) {
          const Interval usual = ModelInfo(model).coefficients[i].usual;
          camera.distortion[i] = (usual.low + usual.high) / 2 +
                                 Uniform(-0.1, 0.1) * (usual.high - usual.low);
        }
    }
    camera.f = px_per_rad.cwiseQuotient(PixelsPerRadian(camera));
    return camera;
  }

  // About some milliseconds after a keyframe.
  KeyframeMotion Motion() {
    KeyframeMotion motion = {.dt_s = Uniform(-0.03, 0.03),
                             .turn = Exp(Normal3(0.05)),
                             .shift_I = Normal3(0.03),
                             .w_I = Normal3(2),
                             .v_I = Normal3(1)};
    motion.readout.turn << motion.w_I, 4 * motion.v_I, -20 * motion.w_I;
    motion.readout.shift << motion.v_I, 2 * motion.w_I, 10 * motion.v_I;
    return motion;
  }

  KeyframeState State(std::int64_t t_ns) {
    return {.t_ns = t_ns,
            .q_GI = Rotation(),
            .p_GI = Normal3(5),
            .v_GI = Normal3(2),
            .b_a = Normal3(0.2),
            .b_g = Normal3(0.02)};
  }

  // Raw readings, independent of each other, over [0, duration_s] and one more
  // on either side of it; none falls on its ends.
  std::vector<ImuSample> Samples(double rate_hz,
                                 double duration_s,
                                 double gyro_sigma = 2,
                                 double accel_sigma = 10) {
    std::vector<ImuSample> samples;
    const auto period_ns = static_cast<std::int64_t>(1e9 / rate_hz);
    const auto end_ns = static_cast<std::int64_t>(1e9 * duration_s);
    auto t_ns = -static_cast<std::int64_t>(Uniform(0.05, 0.95) *
                                           static_cast<double>(period_ns));
    for (; t_ns < end_ns + period_ns; t_ns += period_ns) {
      samples.push_back({t_ns, Normal3(gyro_sigma), Normal3(accel_sigma)});
    }
    return samples;
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

// Largest difference of two matrices, relative to the size of each row.
inline double RowwiseDifference(const Eigen::MatrixXd& a,
                                const Eigen::MatrixXd& b) {
  const Eigen::VectorXd size = b.rowwise().norm().array() + 1;
  return (size.cwiseInverse().asDiagonal() * (a - b)).cwiseAbs().maxCoeff();
}

}  // namespace selfcal
