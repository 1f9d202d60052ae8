#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

TEST(ChangeCameraTest, TurnsTheFirstCameraByTheAngleAndNothingElse) {
  const Calibration theta = StereoRig().factory;
  const double angle_rad = 0.5 * std::numbers::pi / 180;
  const Calibration after = ChangeCamera(theta, {.turn_rad = angle_rad});
  const Eigen::AngleAxisd turn(theta.cameras[0].q_CI.conjugate() *
                               after.cameras[0].q_CI);
  EXPECT_NEAR(turn.angle(), angle_rad, 1e-12);
  EXPECT_LT((turn.axis() - Eigen::Vector3d(1, -2, 2) / 3).norm(), 1e-9);
  Calibration back = after;
  back.cameras[0].q_CI = theta.cameras[0].q_CI;
  EXPECT_EQ(BoxMinus(back, theta).norm(), 0);
}

TEST(ChangeCameraTest, LengthensTheFirstCameraByTheShareAndNothingElse) {
  const Calibration theta = StereoRig().factory;
  const Calibration after = ChangeCamera(theta, {.focal_relative = 0.03});
  EXPECT_NEAR(after.cameras[0].f.x() / theta.cameras[0].f.x(), 1.03, 1e-12);
  EXPECT_NEAR(after.cameras[0].f.y() / theta.cameras[0].f.y(), 1.03, 1e-12);
  Calibration back = after;
  back.cameras[0].f = theta.cameras[0].f;
  EXPECT_LT(BoxMinus(back, theta).norm(), 1e-12);
}

}  // namespace
}  // namespace selfcal
