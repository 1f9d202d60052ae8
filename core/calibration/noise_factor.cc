#include "core/calibration/noise_factor.h"

namespace selfcal {

std::string NoiseKindName(NoiseKind kind) {
  switch (kind) {
    case NoiseKind::kPixel:
      return "pixel";
    case NoiseKind::kGyro:
      return "gyro";
    case NoiseKind::kAccel:
      return "accel";
    case NoiseKind::kGyroBiasWalk:
      return "gyro_bias_walk";
    case NoiseKind::kAccelBiasWalk:
      break;
  }
  return "accel_bias_walk";
}

double* NoiseOf(NoiseKind kind, Rig* rig) {
  switch (kind) {
    case NoiseKind::kPixel:
      return &rig->pixel_sigma_px;
    case NoiseKind::kGyro:
      return &rig->imu_noise.gyro_noise_density;
    case NoiseKind::kAccel:
      return &rig->imu_noise.accel_noise_density;
    case NoiseKind::kGyroBiasWalk:
      return &rig->imu_noise.gyro_bias_random_walk;
    case NoiseKind::kAccelBiasWalk:
      break;
  }
  return &rig->imu_noise.accel_bias_random_walk;
}

}  // namespace selfcal
