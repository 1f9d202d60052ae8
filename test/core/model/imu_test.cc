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

}  // namespace
}  // namespace selfcal
