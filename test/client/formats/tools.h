// The tools' own measurement equations, from their documentation and from
// nothing of ours: what they would make of a file that they are given.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

struct ToolRates {
  Eigen::Vector3d w_B;
  Eigen::Vector3d f_B;
};

struct ToolCamera {
  std::function<Eigen::Vector2d(const Eigen::Vector3d& p_B)> pixel;
  // t_imu - t_camera.
  double offset_s = 0;
};

// In the tool's body frame B, whatever that is.
struct Tool {
  // Of readings without biases; a tool without a model of the IMU gives back
  // what it is given.
  std::function<ToolRates(const Eigen::Vector3d& gyro,
                          const Eigen::Vector3d& accel)>
      correct;
  bool has_imu_model = false;
  // The rates of the body, at its origin, by the readings of a second IMU.
  std::function<ToolRates(const Eigen::Vector3d& gyro,
                          const Eigen::Vector3d& accel)>
      correct_second;
  std::vector<ToolCamera> cameras;
  ImuNoise noise;  // densities
};

// `imu_rate_hz` is for a tool whose noise is by sample.
Tool ReadAsTool(const std::string& format,
                const std::vector<TextFile>& files,
                double imu_rate_hz);

}  // namespace selfcal::client
