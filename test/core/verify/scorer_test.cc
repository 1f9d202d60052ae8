// Compares the two scorers on all kinds of motion.
#include "core/verify/scorer.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <random>
#include <stdexcept>

#include "client/import/vi_map.h"
#include "core/verify/compare_scores.h"
#include "test/core/information/simple_motions.h"
#include "test/core/information/test_segments.h"
#include "test/core/simulation/rigs.h"
#include "test/recordings.h"

namespace selfcal {
namespace {

void ExpectSame(const Rig& rig,
                const Calibration& theta0,
                const MotionSegment& segment,
                const ScoreOptions& options = {}) {
  const SegmentInformation structured =
      ScoreSegmentBy(ScorerKind::kStructured, rig, theta0, segment, options);
  const SegmentInformation ceres =
      ScoreSegmentBy(ScorerKind::kCeres, rig, theta0, segment, options);
  const ScoreDifference difference = CompareScores(rig, structured, ceres);
  EXPECT_LT(difference.entropy_nats, difference.tolerance);
  EXPECT_LT(difference.information, difference.tolerance);
  EXPECT_LT(difference.estimate_sigmas, difference.tolerance);
  std::printf("rank %d: %.1e nat, information %.1e, estimate %.1e sigma\n",
              structured.rank,
              difference.entropy_nats,
              difference.information,
              difference.estimate_sigmas);
  EXPECT_EQ(structured.rank, ceres.rank);
  EXPECT_EQ(structured.unobserved.size(), ceres.unobserved.size());
  EXPECT_EQ(structured.residuals.inliers, ceres.residuals.inliers);
  for (const auto rms_of : {&ResidualStatistics::inertial_rms,
                            &ResidualStatistics::second_inertial_rms}) {
    const std::vector<double>& found = structured.residuals.*rms_of;
    const std::vector<double>& right = ceres.residuals.*rms_of;
    ASSERT_EQ(found.size(), right.size());
    for (std::size_t i = 0; i < right.size(); ++i) {
      EXPECT_NEAR(found[i], right[i], 1e-6 * (1 + found[i]));
    }
  }
  EXPECT_NEAR(structured.residuals.fit, ceres.residuals.fit, 1e-6);
}

TEST(Scorers, AgreeOnEveryKindOfMotion) {
  const Rig rig = HandheldRig("handheld");
  std::mt19937 random(1);
  for (const MotionKind kind : {MotionKind::kRest,
                                MotionKind::kConstantVelocity,
                                MotionKind::kOneAxis,
                                MotionKind::kRotationOnly,
                                MotionKind::kPlanar,
                                MotionKind::kHover,
                                MotionKind::kHandheld}) {
    for (int trial = 0; trial < 3; ++trial) {
      SCOPED_TRACE(testing::Message()
                   << "kind " << static_cast<int>(kind) << ", " << trial);
      SimulationOptions options;
      options.seed = trial + 1;
      const Calibration theta0 = PerturbCalibration(rig.factory, {}, trial + 1);
      ExpectSame(
          rig,
          theta0,
          OneSegment(rig, theta0, *RandomMotion(kind, 4.1, &random), options)
              .slam);
    }
  }
}

TEST(Scorers, AgreeOnEveryLensWithTimesAndHeldComponents) {
  Rig rig = TwoCameraRig();
  rig.factory.cameras[0].time_offset_s = 0.02;
  rig.factory.cameras[1].time_offset_s = -0.013;
  rig.blocks = {{"*.time_offset", true}};
  rig.factory.cameras[1].line_delay_s = 6e-5;
  rig.factory.cameras[1].time_drift = 3e-5;
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  rig.fixed = {"cam0.distortion.*", "imu.q_AI.y"};
  const Calibration theta0 = PerturbCalibration(rig.factory, {}, 3);
  SimulationOptions options;
  options.seed = 3;
  options.keyframes_per_segment = 20;
  options.session_age_s = 50;
  const MotionSegment segment =
      OneSegment(rig, theta0, *MakeHandheld(2.2, 1, 3), options).slam;
  ScoreOptions gauge;
  gauge.gauge_keyframe = 7;
  ExpectSame(rig, theta0, segment, gauge);
}

TEST(Scorers, AgreeOnSlopesWithTemperature) {
  Rig rig = TwoCameraRig();
  rig.factory = WithSlopes(rig.factory);
  rig.factory.imu.q_AI_slope = Eigen::Vector3d(1e-4, -2e-4, 1e-4);
  rig.blocks = {{"*_slope", true}};
  rig.fixed = {"cam1.focal.*", "imu.gyro.scale_slope.y"};
  const Calibration theta0 = PerturbCalibration(rig.factory, {}, 3);
  SimulationOptions options;
  options.temperature_c = 58;
  ExpectSame(rig,
             theta0,
             OneSegment(rig, theta0, *MakeHandheld(4.1, 1, 3), options).slam);
}

TEST(Scorers, AgreeOnTwoImus) {
  Rig rig = HandheldRig("handheld");
  AddSecondImu(&rig);
  rig.blocks = {{"imu1.time_offset", true}};
  rig.fixed = {"imu1.q_JI.y"};
  std::mt19937 random(2);
  for (const MotionKind kind :
       {MotionKind::kRest, MotionKind::kOneAxis, MotionKind::kHandheld}) {
    SCOPED_TRACE(static_cast<int>(kind));
    const Calibration theta0 = PerturbCalibration(rig.factory, {}, 3);
    SimulationOptions options;
    options.seed = 3;
    ExpectSame(
        rig,
        theta0,
        OneSegment(rig, theta0, *RandomMotion(kind, 4.1, &random), options)
            .slam);
  }
}

TEST(Scorers, AgreeWhereNothingIsEstimated) {
  Rig rig = HandheldRig("handheld");
  rig.fixed = {"*"};
  ExpectSame(rig, rig.factory, MovingSegment(rig, 2));
}

// With inertial factors alone, states depend on priors that normal equations
// lose.
TEST(Scorers, CeresReportsThatItCannotScoreWithoutObservations) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment blind = MovingSegment(rig, 2);
  blind.observations.clear();
  blind.landmarks.clear();
  EXPECT_THROW(ScoreSegmentBy(ScorerKind::kCeres, rig, rig.factory, blind),
               std::runtime_error);
}

TEST(Scorers, AgreeOnARecording) {
  SELFCAL_NEED_RECORDING(path, "tango_handheld");
  const auto recording = client::ReadViMap(path, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::vector<MotionSegment> segments = client::BuildSegments(
      *recording, {.session = "recorded", .keyframes = 40});
  ASSERT_GT(segments.size(), 8u);
  for (std::size_t i = 0; i < segments.size(); i += 8) {
    SCOPED_TRACE(i);
    ExpectSame(recording->rig, recording->rig.factory, segments[i]);
  }
}

}  // namespace
}  // namespace selfcal
