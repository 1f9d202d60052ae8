// A smooth motion known in closed form, with what an ideal IMU reads on it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "core/model/so3.h"
#include "test/core/factor/random_values.h"

namespace selfcal {

// Attitude Exp(alpha(t)) and position are sums of a drift and one sine for each
// axis: a device shaken by hand and rotating all the time.
class AnalyticMotion {
 public:
  explicit AnalyticMotion(RandomValues& random)
      : start_(random.Rotation()),
        turn_rate_(random.Normal3(0.5)),
        turn_(Sines(random, 0.3)),
        velocity_(random.Normal3(0.5)),
        shift_(Sines(random, 0.08)) {}

  KeyframeState State(std::int64_t t_ns) const {
    const double t = 1e-9 * static_cast<double>(t_ns);
    return {.t_ns = t_ns,
            .q_GI = start_ * Exp(Alpha(t)),
            .p_GI = velocity_ * t + shift_.Value(t),
            .v_GI = velocity_ + shift_.Rate(t)};
  }

  // Raw readings of a sensor with this calibration and these biases.
  ImuSample Reading(std::int64_t t_ns,
                    const ImuCalibration& imu,
                    const Eigen::Vector3d& b_a,
                    const Eigen::Vector3d& b_g,
                    double gravity_mps2) const {
    const double t = 1e-9 * static_cast<double>(t_ns);
    const Eigen::Vector3d w = AngularRate(t);
    const Eigen::Vector3d f =
        (start_ * Exp(Alpha(t))).conjugate() *
        (shift_.SecondRate(t) + Eigen::Vector3d(0, 0, gravity_mps2));
    constexpr double h = 1e-4;
    const Eigen::Vector3d dw =
        (AngularRate(t + h) - AngularRate(t - h)) / (2 * h);
    ImuSample reading = {t_ns, imu.T_g() * w + b_g, b_a};
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d r = Eigen::Vector3d::Zero();
      if (imu.accel_position.size() == 3) r = imu.accel_position;
      if (imu.accel_position.size() == 9) {
        r = imu.accel_position.segment<3>(3 * axis);
      }
      const Eigen::Vector3d there = f + w.cross(w.cross(r)) + dw.cross(r);
      reading.accel[axis] += imu.T_a().row(axis) * (imu.q_AI * there);
    }
    if (imu.gyro_g_sensitivity.size() > 0) {
      const Eigen::Vector3d read =
          imu.q_AI.conjugate() * (imu.T_a().inverse() * (reading.accel - b_a));
      for (int i = 0; i < 3; ++i) {
        reading.gyro[i] += imu.gyro_g_sensitivity.segment<3>(3 * i).dot(read);
      }
    }
    return reading;
  }

  std::vector<ImuSample> Readings(std::int64_t t0_ns,
                                  std::int64_t t1_ns,
                                  std::int64_t period_ns,
                                  const ImuCalibration& imu,
                                  const Eigen::Vector3d& b_a,
                                  const Eigen::Vector3d& b_g,
                                  double gravity_mps2) const {
    std::vector<ImuSample> samples;
    for (std::int64_t t = t0_ns; t < t1_ns + period_ns; t += period_ns) {
      samples.push_back(Reading(t, imu, b_a, b_g, gravity_mps2));
    }
    return samples;
  }

 private:
  struct SineOfEachAxis {
    Eigen::Array3d amplitude, frequency, phase;
    Eigen::Vector3d Value(double t) const {
      return amplitude * (frequency * t + phase).sin();
    }
    Eigen::Vector3d Rate(double t) const {
      return amplitude * frequency * (frequency * t + phase).cos();
    }
    Eigen::Vector3d SecondRate(double t) const {
      return -amplitude * frequency.square() * (frequency * t + phase).sin();
    }
  };

  static SineOfEachAxis Sines(RandomValues& random, double amplitude) {
    SineOfEachAxis sines;
    for (int i = 0; i < 3; ++i) {
      sines.amplitude[i] = amplitude * random.Uniform(0.5, 1);
      sines.frequency[i] = 2 * M_PI * random.Uniform(0.5, 1.5);
      sines.phase[i] = random.Uniform(0, 2 * M_PI);
    }
    return sines;
  }

  Eigen::Vector3d AngularRate(double t) const {
    return RightJacobian(Alpha(t)) * (turn_rate_ + turn_.Rate(t));
  }
  Eigen::Vector3d Alpha(double t) const {
    return turn_rate_ * t + turn_.Value(t);
  }

  Eigen::Quaterniond start_;
  Eigen::Vector3d turn_rate_;  // [rad/s]
  SineOfEachAxis turn_;
  Eigen::Vector3d velocity_;  // [m/s]
  SineOfEachAxis shift_;
};

}  // namespace selfcal
