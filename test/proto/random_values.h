// Random values of the model, for round trips: any finite bits, no physics.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>

#include "core/model/calibration.h"
#include "core/model/camera_model.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

class RandomValues {
 public:
  explicit RandomValues(std::uint64_t seed) : engine_(seed) {}

  int Int(int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(engine_);
  }
  std::int64_t Int64() { return static_cast<std::int64_t>(engine_()); }

  // Any double that is not a NaN: subnormals, signed zeros, infinities too.
  double Double() {
    for (;;) {
      const std::uint64_t bits = engine_();
      double value;
      std::memcpy(&value, &bits, sizeof(value));
      if (!std::isnan(value)) return value;
    }
  }
  Eigen::Vector2d Vector2() { return {Double(), Double()}; }
  Eigen::Vector3d Vector3() { return {Double(), Double(), Double()}; }
  Eigen::Quaterniond Quaternion() {
    return {Double(), Double(), Double(), Double()};
  }

  // Printable ASCII, no letter left out.
  std::string Text(int size) {
    std::string text;
    for (int i = 0; i < size; ++i) text += static_cast<char>(Int(32, 126));
    return text;
  }

  CameraCalibration Camera() {
    CameraCalibration camera;
    camera.q_CI = Quaternion();
    camera.p_CI = Vector3();
    camera.f = Vector2();
    camera.c = Vector2();
    camera.model = static_cast<DistortionModel>(
        Int(0, static_cast<int>(DistortionModels().size()) - 1));
    camera.distortion.resize(DistortionSize(camera.model));
    for (double& k : camera.distortion) k = Double();
    camera.width_px = Int(0, 10000);
    camera.height_px = Int(0, 10000);
    camera.time_offset_s = Double();
    if (Int(0, 1) == 1) camera.line_delay_s = Double();
    if (Int(0, 1) == 1) camera.time_drift = Double();
    camera.q_CI_slope = Optional(3 * Int(0, 1));
    camera.p_CI_slope = Optional(3 * Int(0, 1));
    camera.f_slope = Optional(2 * Int(0, 1));
    camera.c_slope = Optional(2 * Int(0, 1));
    camera.distortion_slope =
        Optional(static_cast<int>(camera.distortion.size()) * Int(0, 1));
    camera.time_offset_slope = Optional(Int(0, 1));
    return camera;
  }

  OptionalVector Optional(int size) {
    OptionalVector value(size);
    for (double& x : value) x = Double();
    return value;
  }

  Calibration Theta() {
    Calibration theta;
    theta.imu = {Vector3(),
                 Vector3(),
                 Vector3(),
                 Vector3(),
                 Quaternion(),
                 Optional(9 * Int(0, 1)),
                 Optional(3 * Int(0, 3)),
                 Optional(3 * Int(0, 1)),
                 Optional(3 * Int(0, 1)),
                 Optional(3 * Int(0, 1)),
                 Optional(3 * Int(0, 1)),
                 Optional(3 * Int(0, 1))};
    if (Int(0, 1) == 1) {
      SecondImuCalibration& imu = theta.imu1.emplace();
      imu.s_g = Vector3();
      imu.m_g = Vector3();
      imu.s_a = Vector3();
      imu.m_a = Vector3();
      imu.q_AI = Quaternion();
      imu.gyro_g_sensitivity = Optional(9 * Int(0, 1));
      imu.s_a_slope = Optional(3 * Int(0, 1));
      imu.q_JI = Quaternion();
      imu.p_JI = Vector3();
      imu.time_offset_s = Double();
    }
    theta.reference_temperature_c = Double();
    for (int i = Int(0, 4); i > 0; --i) theta.cameras.push_back(Camera());
    return theta;
  }

  Rig RigValue() {
    Rig rig;
    rig.id = "rig-" + std::to_string(Int(0, 1000));
    rig.factory = Theta();
    rig.imu_noise = {Double(), Double(), Double(), Double()};
    rig.pixel_sigma_px = Double();
    rig.gravity_mps2 = 9 + 1e-3 * Int(1, 999);
    rig.groups.clear();
    for (int i = Int(1, 3); i > 0; --i) {
      rig.groups.push_back({Text(5), {Text(3), Text(4)}});
    }
    for (int i = Int(0, 3); i > 0; --i) {
      rig.prior_sigmas.push_back({Text(6), Double()});
    }
    for (int i = Int(0, 3); i > 0; --i) rig.fixed.push_back(Text(7));
    rig.selection = static_cast<Selection>(Int(0, 3));
    rig.table_size = Int(1, 100);
    rig.min_gain_nats = Double();
    rig.retrigger_fraction = Double();
    if (Int(0, 1) == 1) rig.blocks.push_back({"*.time_offset", true});
    for (int i = Int(0, 2); i > 0; --i) {
      rig.blocks.push_back({Text(6), Int(0, 1) == 1});
    }
    rig.reweight_noise = Int(0, 1) == 1;
    rig.imu_full_scale = {1.0 + Int(0, 99), 1.0 + Int(0, 999)};
    if (rig.factory.imu1) {
      rig.imu1_noise = {Double(), Double(), Double(), Double()};
      rig.imu1_full_scale = {1.0 + Int(0, 99), 1.0 + Int(0, 999)};
    }
    if (Int(0, 1) == 1) rig.prior_mean = Theta();
    return rig;
  }

  MotionSegment Segment() {
    MotionSegment segment;
    segment.key = {Text(Int(1, 20)), Int64()};
    segment.calibration_version = Int(1, 1000);
    if (Int(0, 1) == 1) segment.temperature_c = Double();
    if (Int(0, 1) == 1) segment.session_start_ns = Int(-1000, 1000);
    for (int i = Int(0, 20); i > 0; --i) {
      segment.keyframes.push_back(
          {Int64(), Quaternion(), Vector3(), Vector3(), Vector3(), Vector3()});
    }
    for (int i = Int(0, 50); i > 0; --i) {
      segment.imu.push_back({Int64(), Vector3(), Vector3()});
    }
    for (int i = Int(-20, 20); i > 0; --i) {
      segment.imu1.push_back({Int64(), Vector3(), Vector3()});
    }
    for (int i = Int(0, 50); i > 0; --i) {
      segment.landmarks.push_back({engine_(), Vector3()});
    }
    for (int i = Int(0, 50); i > 0; --i) {
      segment.observations.push_back(
          {Int(-5, 1000), Int(-5, 9), Int(-5, 1000), Vector2()});
    }
    return segment;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace selfcal
