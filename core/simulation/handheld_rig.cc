#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

CameraCalibration HandheldCamera() {
  CameraCalibration camera;
  // The camera looks along x of the body (R_CI rotates forward, left, up into
  // right, down, forward), with a mounting error of about two degrees.
  Eigen::Matrix3d R_CI;
  R_CI << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  camera.q_CI = Exp({0.022, -0.013, 0.031}) * Eigen::Quaterniond(R_CI);
  camera.q_CI.normalize();
  camera.p_CI = {0.034, -0.012, 0.021};
  camera.f = {255, 255};
  camera.c = {318, 242};
  camera.model = DistortionModel::kFov;
  camera.distortion = DistortionVector::Constant(1, 0.92);
  camera.width_px = 640;
  camera.height_px = 480;
  return camera;
}

}  // namespace

Rig HandheldRig(const std::string& id) {
  Rig rig;
  rig.id = id;
  ImuCalibration& imu = rig.factory.imu;
  imu.s_g = {1.006, 0.994, 1.009};
  imu.m_g = {0.004, -0.005, 0.006};
  imu.s_a = {0.988, 1.011, 0.993};
  imu.m_a = {-0.006, 0.005, 0.004};
  imu.q_AI = Exp(0.0174533 * Eigen::Vector3d(2, -1, 2) / 3);
  rig.factory.cameras = {HandheldCamera()};
  rig.imu_noise.gyro_noise_density = 1.7e-4;
  rig.imu_noise.accel_noise_density = 2e-3;
  rig.imu_noise.gyro_bias_random_walk = 2e-5;
  rig.imu_noise.accel_bias_random_walk = 3e-4;
  rig.pixel_sigma_px = 0.8;
  return rig;
}

void AddSecondImu(Rig* rig) {
  SecondImuCalibration& imu = rig->factory.imu1.emplace();
  imu.s_g = {0.991, 1.007, 0.996};
  imu.m_g = {-0.005, 0.004, 0.003};
  imu.s_a = {1.009, 0.987, 1.012};
  imu.m_a = {0.005, -0.004, 0.006};
  imu.q_AI = Exp(0.0174533 * Eigen::Vector3d(-1, 2, 2) / 3);
  Eigen::Matrix3d R_JI;
  R_JI << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  imu.q_JI = Exp({0.03, 0.02, -0.04}) * Eigen::Quaterniond(R_JI);
  imu.q_JI.normalize();
  imu.p_JI = {0.041, -0.027, 0.018};
  rig->imu1_noise.gyro_noise_density = 2.4e-4;
  rig->imu1_noise.accel_noise_density = 3e-3;
  rig->imu1_noise.gyro_bias_random_walk = 3e-5;
  rig->imu1_noise.accel_bias_random_walk = 4e-4;
  rig->groups = DefaultGroups(rig->blocks, rig->factory);
}

}  // namespace selfcal
