#include "core/information/segment_residuals.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/factor/inertial_batch.h"
#include "core/model/so3.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

// A SLAM system's states, a factory's calibration, some wrong matches.
struct Device {
  explicit Device(std::uint64_t seed) : rig(HandheldRig("handheld")) {
    SimulationOptions options;
    options.seed = seed;
    options.outlier_fraction = 0.05;
    theta = PerturbCalibration(rig.factory, {}, seed);
    segment = OneSegment(rig, theta, *MakeHandheld(4.1, 1, seed), options).slam;
  }
  Rig rig;
  Calibration theta;
  MotionSegment segment;
};

TEST(SegmentResiduals, AreThoseThatAScoreUses) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Device device(seed);
    const SegmentInformation scored =
        ScoreSegment(device.rig, device.theta, device.segment);
    const SegmentResiduals residuals =
        EvaluateResiduals(device.rig, device.theta, device.segment);
    ASSERT_EQ(residuals.observations.size(),
              device.segment.observations.size());
    double squares = 0;
    int inliers = 0, not_projectable = 0;
    for (const ObservationResidual& o : residuals.observations) {
      not_projectable += o.projects ? 0 : 1;
      if (!o.inlier) continue;
      EXPECT_TRUE(o.projects);
      ++inliers;
      squares += o.residual_px.squaredNorm();
    }
    EXPECT_EQ(inliers, scored.residuals.inliers);
    EXPECT_LT(inliers, scored.residuals.observations) << "nothing was wrong";
    EXPECT_EQ(not_projectable, scored.residuals.not_projectable);
    EXPECT_NEAR(std::sqrt(squares / inliers),
                scored.residuals.reprojection_rms_px,
                1e-9);
    ASSERT_EQ(residuals.statistics.inertial_rms.size(),
              scored.residuals.inertial_rms.size());
    for (std::size_t k = 0; k < scored.residuals.inertial_rms.size(); ++k) {
      EXPECT_NEAR(residuals.statistics.inertial_rms[k],
                  scored.residuals.inertial_rms[k],
                  1e-6 * scored.residuals.inertial_rms[k]);
    }
    EXPECT_EQ(residuals.statistics.outliers, scored.residuals.outliers);
  }
}

TEST(SegmentResiduals, IntervalsAreWhitenedAsTheScoreWhitensThem) {
  const Device device(4);
  const auto& keyframes = device.segment.keyframes;
  const SegmentResiduals residuals =
      EvaluateResiduals(device.rig, device.theta, device.segment);
  ASSERT_EQ(residuals.intervals.size(), keyframes.size() - 1);
  std::vector<InertialLinkStates> links;
  for (std::size_t k = 0; k + 1 < keyframes.size(); ++k) {
    links.push_back({&keyframes[k],
                     &keyframes[k + 1],
                     SamplesFromFirstKeyframe(device.segment)});
  }
  std::vector<InertialNoiseRoot> roots(links.size());
  InertialTransitions transitions;
  InertialBatch(WidestVectors())
      .Linearise(links,
                 device.theta.imu,
                 device.rig.imu_noise,
                 device.rig.gravity_mps2,
                 roots,
                 &transitions);
  for (std::size_t k = 0; k < links.size(); ++k) {
    for (int j = 0; j < kStateTangentSize; ++j) {
      EXPECT_NEAR(residuals.intervals[k].whitened[j],
                  transitions[k].whitened[j],
                  1e-6 * (1 + std::abs(transitions[k].whitened[j])))
          << "interval " << k << ", " << j;
    }
  }
}

// A second IMU whose pose and intrinsics are those that are stated leaves what
// its noise explains; one that is turned does not.
TEST(SegmentResiduals, OfASecondImuAreThoseOfItsOwnReadings) {
  Rig rig = HandheldRig("handheld");
  EXPECT_TRUE(
      EvaluateResiduals(
          rig,
          rig.factory,
          OneSegment(rig, rig.factory, *MakeHandheld(4.1, 1, 1), {}).truth)
          .second_intervals.empty());
  AddSecondImu(&rig);
  const MotionSegment segment =
      OneSegment(rig, rig.factory, *MakeHandheld(4.1, 1, 1), {}).truth;
  const SegmentResiduals residuals =
      EvaluateResiduals(rig, rig.factory, segment);
  ASSERT_EQ(residuals.second_intervals.size(), segment.keyframes.size() - 1);
  const std::vector<double>& right = residuals.statistics.second_inertial_rms;
  Calibration turned = rig.factory;
  turned.imu1->q_JI = turned.imu1->q_JI * Exp({0.05, 0, 0});
  const std::vector<double> wrong =
      EvaluateResiduals(rig, turned, segment).statistics.second_inertial_rms;
  ASSERT_EQ(right.size(), 5u);
  const std::vector<double> scored =
      ScoreSegment(rig, rig.factory, segment).residuals.second_inertial_rms;
  ASSERT_EQ(scored.size(), right.size());
  for (std::size_t k = 0; k < right.size(); ++k) {
    EXPECT_NEAR(scored[k], right[k], 1e-6 * right[k]);
  }
  // Rotation and position; biases are constant in each segment.
  EXPECT_LT(right[0], 1.5);
  EXPECT_GT(wrong[0], 3 * right[0]);
  EXPECT_EQ(right[3], 0);
  EXPECT_EQ(right[4], 0);
}

// One that was moved manually: its residual is the displacement.
TEST(SegmentResiduals, AMovedMeasurementHasItsResidualAndIsNoInlier) {
  const Rig rig = TwoCameraRig();
  MotionSegment segment = MovingSegment(rig, 1);
  const Eigen::Vector2d moved(8, -6);
  const int index = static_cast<int>(segment.observations.size() / 2);
  Eigen::Vector2d& z_px = segment.observations[index].z_px;
  z_px += moved;
  const SegmentResiduals residuals =
      EvaluateResiduals(rig, rig.factory, segment);
  for (int i = 0; i < static_cast<int>(residuals.observations.size()); ++i) {
    const ObservationResidual& o = residuals.observations[i];
    ASSERT_TRUE(o.projects);
    EXPECT_EQ(o.inlier, i != index) << i;
    if (i == index) {
      EXPECT_LT((o.residual_px + moved).norm(), 2) << o.residual_px;
    }
  }
}

}  // namespace
}  // namespace selfcal
