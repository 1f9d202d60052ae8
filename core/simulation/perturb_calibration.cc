#include <cmath>
#include <numbers>

#include "core/model/so3.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Perturbs each entry by the amount, up or down.
Eigen::Vector3d Signs(Random* random) {
  const double x = random->Sign();
  const double y = random->Sign();
  const double z = random->Sign();
  return {x, y, z};
}

Eigen::Quaterniond Turn(const Eigen::Quaterniond& q,
                        double angle_rad,
                        Random* random) {
  return (q * Exp(angle_rad * random->Direction())).normalized();
}

void PerturbImu(const CalibrationError& error,
                Random* random,
                ImuCalibration* imu) {
  imu->s_g += error.scale * Signs(random);
  imu->m_g += error.misalignment * Signs(random);
  imu->s_a += error.scale * Signs(random);
  imu->m_a += error.misalignment * Signs(random);
  imu->q_AI = Turn(imu->q_AI, error.accel_rotation_rad, random);
}

void PerturbCamera(const CalibrationError& error,
                   Random* random,
                   CameraCalibration* camera) {
  camera->q_CI = Turn(camera->q_CI, error.camera_rotation_rad, random);
  camera->p_CI += error.camera_position_m * random->Direction();
  camera->f *= 1 + error.focal_relative * random->Sign();
  const double angle = random->Uniform(0, 2 * std::numbers::pi);
  camera->c += error.principal_point_px *
               Eigen::Vector2d(std::cos(angle), std::sin(angle));
  for (double& coefficient : camera->distortion) {
    coefficient *= 1 + error.distortion_relative * random->Sign();
  }
}

}  // namespace

Calibration PerturbCalibration(const Calibration& theta,
                               const CalibrationError& error,
                               std::uint64_t seed) {
  Random random(seed, kPerturbStream);
  Calibration perturbed = theta;
  PerturbImu(error, &random, &perturbed.imu);
  for (CameraCalibration& camera : perturbed.cameras) {
    PerturbCamera(error, &random, &camera);
  }
  if (perturbed.imu1) {
    SecondImuCalibration& imu = *perturbed.imu1;
    PerturbImu(error, &random, &imu);
    imu.q_JI = Turn(imu.q_JI, error.imu_rotation_rad, &random);
    imu.p_JI += error.imu_position_m * random.Direction();
  }
  return perturbed;
}

}  // namespace selfcal
