// Random values of the model, for tests; the same seed gives the same values.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "core/model/calibration.h"
#include "core/model/camera.h"
#include "core/model/camera_model.h"
#include "core/model/so3.h"

namespace selfcal {

class RandomValues {
 public:
  explicit RandomValues(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }

  // Evenly spread over the orders of magnitude, either sign.
  double SignedMagnitude(double low, double high) {
    const double value = std::exp(Uniform(std::log(low), std::log(high)));
    return Uniform(-1, 1) < 0 ? -value : value;
  }

  Eigen::VectorXd Vector(int n, double scale) {
    Eigen::VectorXd v(n);
    for (double& value : v) value = Uniform(-scale, scale);
    return v;
  }

  Eigen::Vector3d Direction() {
    std::normal_distribution<double> normal;
    return Eigen::Vector3d(normal(engine_), normal(engine_), normal(engine_))
        .normalized();
  }

  Eigen::Quaterniond Rotation() {
    return Exp(Uniform(0, 3.14159) * Direction());
  }

  // Coefficients as of real lenses, and somewhat beyond, either way.
  DistortionVector Distortion(DistortionModel model) {
    DistortionVector k(DistortionSize(model));
    for (int i = 0; i < k.size(); ++i) {
      const Interval usual = ModelInfo(model).coefficients[i].usual;
      k[i] = Uniform(usual.low, usual.high);
    }
    return k;
  }

  // The middle of the image has 200 to 600 px per radian.
  CameraCalibration Camera(DistortionModel model) {
    CameraCalibration camera;
    camera.q_CI = Rotation();
    camera.p_CI = Vector(3, 0.2);
    camera.model = model;
    camera.distortion = Distortion(model);
    const Eigen::Vector2d px_per_rad(Uniform(200, 600), Uniform(200, 600));
    camera.f = px_per_rad.cwiseQuotient(PixelsPerRadian(camera));
    camera.c = Eigen::Vector2d(Uniform(300, 340), Uniform(220, 260));
    camera.width_px = 640;
    camera.height_px = 480;
    return camera;
  }

  // Three cameras of different models.
  Calibration Theta() {
    Calibration theta;
    theta.imu.s_g += Vector(3, 0.02);
    theta.imu.m_g = Vector(3, 0.02);
    theta.imu.s_a += Vector(3, 0.05);
    theta.imu.m_a = Vector(3, 0.05);
    theta.imu.q_AI = Rotation();
    theta.cameras = {Camera(DistortionModel::kFov),
                     Camera(DistortionModel::kRadialTangential),
                     Camera(DistortionModel::kEquidistant)};
    for (CameraCalibration& camera : theta.cameras) {
      camera.time_offset_s = Uniform(-0.03, 0.03);
    }
    return theta;
  }

  // The same with a second IMU, which has optional blocks.
  Calibration ThetaOfTwoImus() {
    Calibration theta = Theta();
    SecondImuCalibration& imu = theta.imu1.emplace();
    imu.s_g += Vector(3, 0.02);
    imu.m_g = Vector(3, 0.02);
    imu.s_a += Vector(3, 0.05);
    imu.m_a = Vector(3, 0.05);
    imu.q_AI = Rotation();
    imu.gyro_g_sensitivity = Vector(9, 1e-3);
    imu.accel_position = Vector(3, 0.05);
    imu.q_JI = Rotation();
    imu.p_JI = Vector(3, 0.1);
    imu.time_offset_s = Uniform(-0.01, 0.01);
    return theta;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace selfcal
