// Prints what core/model makes of random calibrations, for the Python package
// to make the same of them: a line each of
//   imu s_g m_g s_a m_a q_AI(w x y z) gyro accel b_g b_a dw_I w_I f_I
//     and then 0 or 9 numbers of T_s row by row, and 0, 3 or 9 of r
//   camera MODEL f c coefficients...
//   project p_C found z_px         with the camera before
//   unproject z_px found bearing_C
#include <cstdio>
#include <initializer_list>
#include <string>

#include "core/model/camera.h"
#include "core/model/camera_model.h"
#include "core/model/imu.h"
#include "test/core/model/random_values.h"

namespace {

using selfcal::RandomValues;

void Print(const char* what,
           const std::initializer_list<Eigen::VectorXd>& all) {
  std::printf("%s", what);
  for (const Eigen::VectorXd& values : all) {
    for (const double value : values) std::printf(" %.17g", value);
  }
  std::printf("\n");
}

void PrintImu(const selfcal::ImuCalibration& imu, RandomValues* random) {
  const Eigen::Vector3d gyro = random->Vector(3, 5);
  const Eigen::Vector3d accel = random->Vector(3, 20);
  const Eigen::Vector3d b_g = random->Vector(3, 0.1);
  const Eigen::Vector3d b_a = random->Vector(3, 0.5);
  const Eigen::Vector3d dw_I = random->Vector(3, 20);
  const selfcal::BodyRates rates =
      selfcal::CorrectImu(imu, gyro, accel, b_g, b_a, dw_I);
  const Eigen::Vector4d q(
      imu.q_AI.w(), imu.q_AI.x(), imu.q_AI.y(), imu.q_AI.z());
  Print("imu",
        {imu.s_g,
         imu.m_g,
         imu.s_a,
         imu.m_a,
         q,
         gyro,
         accel,
         b_g,
         b_a,
         dw_I,
         rates.w_I,
         rates.f_I,
         imu.gyro_g_sensitivity,
         imu.accel_position});
}

void PrintCamera(const selfcal::CameraCalibration& camera,
                 RandomValues* random) {
  Print(("camera " + std::string(DistortionName(camera.model))).c_str(),
        {camera.f, camera.c, camera.distortion});
  for (int i = 0; i < 50; ++i) {
    Eigen::Vector3d p_C = random->Vector(3, 2);
    if (i == 0) p_C = Eigen::Vector3d::UnitZ();
    Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
    bool found = Project(camera, p_C, &z_px, nullptr);
    Print("project", {p_C, Eigen::VectorXd::Constant(1, found), z_px});
    z_px =
        Eigen::Vector2d(random->Uniform(-300, 900), random->Uniform(-300, 800));
    if (i == 0) z_px = camera.c;
    Eigen::Vector3d bearing_C = Eigen::Vector3d::Zero();
    found = Unproject(camera, z_px, &bearing_C);
    Print("unproject", {z_px, Eigen::VectorXd::Constant(1, found), bearing_C});
  }
}

}  // namespace

int main() {
  RandomValues random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const selfcal::Calibration theta = random.Theta();
    PrintImu(theta.imu, &random);
    selfcal::ImuCalibration coupled = theta.imu;
    coupled.gyro_g_sensitivity = random.Vector(trial % 2 * 9, 1e-2);
    coupled.accel_position = random.Vector(trial % 3 == 0 ? 3 : 9, 0.1);
    PrintImu(coupled, &random);
    for (const selfcal::DistortionModel model : selfcal::DistortionModels()) {
      PrintCamera(random.Camera(model), &random);
    }
  }
}
