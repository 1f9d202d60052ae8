#include <gtest/gtest.h>

#include <cmath>

#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

void ExpectEachOffBy(const Eigen::VectorXd& a,
                     const Eigen::VectorXd& b,
                     double amount) {
  for (Eigen::Index i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(std::abs(a[i] - b[i]), amount, 1e-12);
  }
}

TEST(PerturbCalibrationTest, EveryBlockIsOffByExactlyTheGivenAmount) {
  const Calibration theta = StereoRig().factory;
  CalibrationError error;
  error.focal_relative = 0.03;
  error.principal_point_px = 4;
  error.distortion_relative = 0.02;
  error.camera_rotation_rad = 0.05;
  error.camera_position_m = 0.02;
  error.scale = 0.015;
  error.misalignment = 0.007;
  error.accel_rotation_rad = 0.04;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Calibration off = PerturbCalibration(theta, error, seed);
    ASSERT_TRUE(SameShape(theta, off));
    ExpectEachOffBy(off.imu.s_g, theta.imu.s_g, error.scale);
    ExpectEachOffBy(off.imu.s_a, theta.imu.s_a, error.scale);
    ExpectEachOffBy(off.imu.m_g, theta.imu.m_g, error.misalignment);
    ExpectEachOffBy(off.imu.m_a, theta.imu.m_a, error.misalignment);
    EXPECT_NEAR(off.imu.q_AI.angularDistance(theta.imu.q_AI),
                error.accel_rotation_rad,
                1e-9);
    for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
      const CameraCalibration& a = theta.cameras[j];
      const CameraCalibration& b = off.cameras[j];
      EXPECT_NEAR(
          b.q_CI.angularDistance(a.q_CI), error.camera_rotation_rad, 1e-9);
      EXPECT_NEAR(b.q_CI.norm(), 1, 1e-12);
      EXPECT_NEAR((b.p_CI - a.p_CI).norm(), error.camera_position_m, 1e-12);
      EXPECT_NEAR((b.c - a.c).norm(), error.principal_point_px, 1e-9);
      EXPECT_NEAR(std::abs(b.f.x() / a.f.x() - 1), 0.03, 1e-12);
      EXPECT_NEAR(b.f.x() / a.f.x(), b.f.y() / a.f.y(), 1e-12);
      for (Eigen::Index i = 0; i < a.distortion.size(); ++i) {
        EXPECT_NEAR(
            std::abs(b.distortion[i] / a.distortion[i] - 1), 0.02, 1e-12);
      }
    }
  }
}

TEST(PerturbCalibrationTest, DirectionsComeFromTheSeed) {
  const Calibration theta = HandheldRig("a").factory;
  const Calibration a = PerturbCalibration(theta, {}, 1);
  const Calibration same = PerturbCalibration(theta, {}, 1);
  const Calibration other = PerturbCalibration(theta, {}, 2);
  EXPECT_EQ(a.cameras[0].p_CI, same.cameras[0].p_CI);
  EXPECT_EQ(a.imu.q_AI.coeffs(), same.imu.q_AI.coeffs());
  EXPECT_NE(a.cameras[0].p_CI, other.cameras[0].p_CI);
}

}  // namespace
}  // namespace selfcal
