// Applies a calibration: readings to rates, points to pixels and pixels to
// rays, compared with the truth of the simulation.
#include <gtest/gtest.h>

#include "core/model/camera.h"
#include "core/model/imu.h"
#include "core/simulation/imu_readings.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

TEST(ApplyCalibration, CorrectImuGivesTheMotionThatMadeTheReadings) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.noise = false;
  const ImuReadings imu =
      SimulateImu(rig, rig.factory.imu, *MakeHandheld(5, 1, 3), options);
  ASSERT_EQ(imu.measured.size(), 1001u);
  for (std::size_t i = 0; i < imu.measured.size(); ++i) {
    const BodyRates rates = CorrectImu(rig.factory.imu,
                                       imu.measured[i].gyro,
                                       imu.measured[i].accel,
                                       imu.b_g[i],
                                       imu.b_a[i]);
    EXPECT_LT((rates.w_I - imu.w_I[i]).norm(), 1e-12);
    EXPECT_LT((rates.f_I - imu.f_I[i]).norm(), 1e-11);
  }
}

TEST(ApplyCalibration, PixelsAreThoseOfTheLandmarksAndRaysLeadBack) {
  const Rig rig = RigOfCameras(4);
  const SimulatedSession session = SimulateHandheld(rig, 6, PerfectSlam());
  ASSERT_FALSE(session.truth.empty());
  const MotionSegment& truth = session.truth[0];
  ASSERT_GT(truth.observations.size(), 1000u);
  for (const Observation& seen : truth.observations) {
    const CameraCalibration& camera = rig.factory.cameras[seen.camera];
    const KeyframeState& x = truth.keyframes[seen.keyframe];
    const Eigen::Vector3d p_I =
        x.q_GI.conjugate() * (truth.landmarks[seen.landmark].p_G - x.p_GI);
    const Eigen::Vector3d p_C = camera.q_CI * p_I + camera.p_CI;
    Eigen::Vector2d z_px;
    ASSERT_TRUE(Project(camera, p_C, &z_px, nullptr));
    EXPECT_LT((z_px - seen.z_px).norm(), 1e-6);
    Eigen::Vector3d bearing_C;
    ASSERT_TRUE(Unproject(camera, seen.z_px, &bearing_C));
    EXPECT_LT(bearing_C.cross(p_C.normalized()).norm(), 1e-8);
    ASSERT_TRUE(Project(camera, bearing_C, &z_px, nullptr));
    EXPECT_LT((z_px - seen.z_px).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace selfcal
