#include <gtest/gtest.h>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

TEST(HandheldRigTest, IsAValidRigWithTheGivenId) {
  const Rig rig = HandheldRig("tablet-7");
  EXPECT_EQ(rig.id, "tablet-7");
  for (const Violation& violation : Validate(rig)) {
    ADD_FAILURE() << violation.field << ": " << violation.message;
  }
}

TEST(HandheldRigTest, HasOneFovCameraAndAnImuThatIsNotNominal) {
  const Rig rig = HandheldRig("a");
  ASSERT_EQ(rig.factory.cameras.size(), 1u);
  EXPECT_EQ(rig.factory.cameras[0].model, DistortionModel::kFov);
  EXPECT_EQ(FreeComponents(rig).size(), 26u);
  const ImuCalibration nominal;
  EXPECT_GT((rig.factory.imu.s_a - nominal.s_a).norm(), 0.01);
  EXPECT_NEAR(
      rig.factory.imu.q_AI.angularDistance(nominal.q_AI), 0.0174533, 1e-9);
}

TEST(HandheldRigTest, TheCameraLooksAlongTheBodysX) {
  const CameraCalibration camera = HandheldRig("a").factory.cameras[0];
  const Eigen::Vector3d forward_C = camera.q_CI * Eigen::Vector3d::UnitX();
  EXPECT_GT(forward_C.z(), 0.99);
}

}  // namespace
}  // namespace selfcal
