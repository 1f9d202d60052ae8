// What a tool predicts from its files, against what selfcal does.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <string>

#include "core/model/camera.h"
#include "core/model/imu.h"
#include "test/client/formats/tools.h"
#include "test/core/model/random_values.h"

namespace selfcal::client {

// The frames of both differ by a rotation that is nobody's business: so a point
// is given by where it is against the motion, in terms of the corrected rates.
// That a tool sees it at the same pixel says that its rates and its extrinsics
// fit each other as ours do.
inline void ExpectSamePredictions(const Calibration& theta,
                                  const Tool& tool,
                                  RandomValues* random) {
  ASSERT_EQ(tool.cameras.size(), theta.cameras.size());
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d gyro = 2 * random->Direction();
    const Eigen::Vector3d accel = 10 * random->Direction();
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const BodyRates ours = CorrectImu(theta.imu, gyro, accel, zero, zero);
    // A tool without a model of the IMU gets what CorrectImu makes.
    const ToolRates its = tool.has_imu_model ? tool.correct(gyro, accel)
                                             : tool.correct(ours.w_I, ours.f_I);
    EXPECT_NEAR(its.w_B.norm(), ours.w_I.norm(), 1e-9);
    EXPECT_NEAR(its.f_B.norm(), ours.f_I.norm(), 1e-9);
    EXPECT_NEAR(its.w_B.dot(its.f_B), ours.w_I.dot(ours.f_I), 1e-8);
    Eigen::Matrix3d ours_basis;
    ours_basis << ours.w_I, ours.f_I, ours.w_I.cross(ours.f_I);
    Eigen::Matrix3d its_basis;
    its_basis << its.w_B, its.f_B, its.w_B.cross(its.f_B);
    if (std::abs(ours_basis.determinant()) < 1) continue;  // nearly parallel
    for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
      const CameraCalibration& camera = theta.cameras[j];
      EXPECT_NEAR(tool.cameras[j].offset_s, camera.time_offset_s, 1e-9);
      const Eigen::Vector2d z_px(random->Uniform(0, camera.width_px),
                                 random->Uniform(0, camera.height_px));
      Eigen::Vector3d bearing_C;
      if (!Unproject(camera, z_px, &bearing_C)) continue;
      const Eigen::Vector3d p_I =
          camera.q_CI.conjugate() *
          (random->Uniform(0.3, 8) * bearing_C - camera.p_CI);
      const Eigen::Vector3d p_B =
          its_basis * (ours_basis.inverse() * p_I).eval();
      const Eigen::Vector2d its_px = tool.cameras[j].pixel(p_B);
      // A tool has the equidistant model as a pinhole, or as a whole camera.
      if (its_px.hasNaN()) {
        EXPECT_LE(bearing_C.z(), 1e-9);
        continue;
      }
      EXPECT_LT((its_px - z_px).norm(), 1e-5);
    }
  }
}

// Compares what both make of the readings of the second IMU, by the frame that
// those of the first define.
inline void ExpectSameSecondImu(const Calibration& theta,
                                const Tool& tool,
                                RandomValues* random) {
  ASSERT_TRUE(tool.correct_second);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::Matrix3d R_IJ =
      theta.imu1->q_JI.conjugate().normalized().toRotationMatrix();
  const Eigen::Vector3d r_I = -R_IJ * theta.imu1->p_JI;
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d gyro = 2 * random->Direction();
    const Eigen::Vector3d accel = 10 * random->Direction();
    const BodyRates first = CorrectImu(theta.imu, gyro, accel, zero, zero);
    const ToolRates its_first = tool.correct(gyro, accel);
    Eigen::Matrix3d ours_basis;
    ours_basis << first.w_I, first.f_I, first.w_I.cross(first.f_I);
    Eigen::Matrix3d its_basis;
    its_basis << its_first.w_B, its_first.f_B,
        its_first.w_B.cross(its_first.f_B);
    if (std::abs(ours_basis.determinant()) < 1) continue;  // nearly parallel
    const Eigen::Matrix3d R_BI = its_basis * ours_basis.inverse();
    const BodyRates second = CorrectImu(*theta.imu1, gyro, accel, zero, zero);
    const Eigen::Vector3d w_I = R_IJ * second.w_I;
    const Eigen::Vector3d f_I = R_IJ * second.f_I - w_I.cross(w_I.cross(r_I));
    const ToolRates its_second = tool.correct_second(gyro, accel);
    EXPECT_LT((its_second.w_B - R_BI * w_I).norm(), 1e-8);
    EXPECT_LT((its_second.f_B - R_BI * f_I).norm(), 1e-7);
  }
}

inline void ExpectSameNoise(const ImuNoise& a, const ImuNoise& b) {
  EXPECT_DOUBLE_EQ(a.gyro_noise_density, b.gyro_noise_density);
  EXPECT_DOUBLE_EQ(a.accel_noise_density, b.accel_noise_density);
  EXPECT_DOUBLE_EQ(a.gyro_bias_random_walk, b.gyro_bias_random_walk);
  EXPECT_DOUBLE_EQ(a.accel_bias_random_walk, b.accel_bias_random_walk);
}

}  // namespace selfcal::client
