#include "core/model/imu.h"

#include <gtest/gtest.h>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

TEST(CorrectImu, InvertsTheReadingsOfAnyCalibration) {
  RandomValues random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const ImuCalibration imu = random.Theta().imu;
    const Eigen::Vector3d w_I = random.Vector(3, 5);
    const Eigen::Vector3d f_I = random.Vector(3, 30);
    const Eigen::Vector3d b_g = random.Vector(3, 0.05);
    const Eigen::Vector3d b_a = random.Vector(3, 0.5);
    const BodyRates rates =
        CorrectImu(imu,
                   imu.T_g() * w_I + b_g,
                   imu.T_a() * imu.q_AI.toRotationMatrix() * f_I + b_a,
                   b_g,
                   b_a);
    EXPECT_LT((rates.w_I - w_I).norm(), 1e-13);
    EXPECT_LT((rates.f_I - f_I).norm(), 1e-12);
  }
}

// The readings are written out as the formulas of ImuCalibration have them.
TEST(CorrectImu, InvertsTheReadingsOfSensorsThatAreCoupled) {
  RandomValues random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    ImuCalibration imu = random.Theta().imu;
    const int positions = trial % 3 == 0 ? 0 : trial % 3 == 1 ? 3 : 9;
    imu.accel_position = random.Vector(positions, 0.1);
    if (trial % 2 == 0) imu.gyro_g_sensitivity = random.Vector(9, 1e-2);
    const Eigen::Vector3d w = random.Vector(3, 5);
    const Eigen::Vector3d dw = random.Vector(3, 50);
    const Eigen::Vector3d f_I = random.Vector(3, 30);
    const Eigen::Vector3d b_g = random.Vector(3, 0.05);
    const Eigen::Vector3d b_a = random.Vector(3, 0.5);
    Eigen::Vector3d accel = b_a;
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d r = Eigen::Vector3d::Zero();
      for (int i = 0; i < 3; ++i) {
        if (positions == 3) r[i] = imu.accel_position[i];
        if (positions == 9) r[i] = imu.accel_position[3 * axis + i];
      }
      const Eigen::Vector3d f = f_I + w.cross(w.cross(r)) + dw.cross(r);
      accel[axis] += (imu.T_a() * (imu.q_AI * f))[axis];
    }
    Eigen::Vector3d gyro = imu.T_g() * w + b_g;
    const Eigen::Vector3d f_read =
        imu.q_AI.conjugate() * (imu.T_a().inverse() * (accel - b_a));
    for (int i = 0; i < 9 && trial % 2 == 0; ++i) {
      gyro[i / 3] += imu.gyro_g_sensitivity[i] * f_read[i % 3];
    }
    const BodyRates rates = CorrectImu(imu, gyro, accel, b_g, b_a, dw);
    EXPECT_LT((rates.w_I - w).norm(), 1e-13);
    EXPECT_LT((rates.f_I - f_I).norm(), 1e-12);
  }
}

// The second calibration corrects the same readings to the same values.
TEST(CarryBiases, KeepsWhatReadingsAtRestMean) {
  RandomValues random(3);
  for (int trial = 0; trial < 100; ++trial) {
    ImuCalibration from = random.Theta().imu;
    ImuCalibration to = random.Theta().imu;
    if (trial % 2 == 0) from.gyro_g_sensitivity = random.Vector(9, 1e-2);
    if (trial % 3 == 0) to.gyro_g_sensitivity = random.Vector(9, 1e-2);
    if (trial % 5 == 0) to.accel_position = random.Vector(9, 0.1);
    const Eigen::Vector3d f_I = random.Vector(3, 10);
    const ImuBiases old{random.Vector(3, 0.05), random.Vector(3, 0.5)};
    const Eigen::Vector3d accel =
        from.T_a() * from.q_AI.toRotationMatrix() * f_I + old.b_a;
    const Eigen::Vector3d gyro = from.T_s() * f_I + old.b_g;
    const ImuBiases carried = CarryBiases(from, to, f_I, old);
    const BodyRates rates =
        CorrectImu(to, gyro, accel, carried.b_g, carried.b_a);
    EXPECT_LT(rates.w_I.norm(), 1e-12);
    EXPECT_LT((rates.f_I - f_I).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace selfcal
