#include "core/calibration/noise_scales.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/calibration/calibrate.h"
#include "test/core/calibration/noisy_walk.h"

namespace selfcal {
namespace {

constexpr int At(NoiseKind kind) { return static_cast<int>(kind); }

CalibrationResult CalibrateBelieving(
    const Rig& believed, const std::vector<MotionSegment>& segments) {
  return Calibrate(believed, believed.factory, segments);
}

double FactorOf(const CalibrationResult& result, NoiseKind kind) {
  return result.noise_scales.at(At(kind)).factor;
}

// Observations of one landmark in eight err, as if the focal length were
// larger.
void MoveOutwards(const Rig& rig, double error_px, MotionSegment* segment) {
  for (Observation& seen : segment->observations) {
    if (segment->landmarks[seen.landmark].id % 8 != 0) continue;
    const Eigen::Vector2d centre = rig.factory.cameras[seen.camera].c;
    seen.z_px += error_px * (seen.z_px - centre).normalized();
  }
}

// The true noise is `off` times the assumed noise.
void ExpectFound(const std::vector<NoiseKind>& kinds, double off) {
  const Rig truth = NoisyRig();
  const std::vector<MotionSegment> segments = Walk(truth, 3, 40, 100, 3);
  Rig believed = truth;
  for (const NoiseKind kind : kinds) ScaleNoise(kind, 1 / off, &believed);
  const CalibrationResult result = CalibrateBelieving(believed, segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged);
  ASSERT_EQ(result.noise_scales.size(), 5u);
  for (const NoiseKind kind :
       {NoiseKind::kPixel, NoiseKind::kGyro, NoiseKind::kAccel}) {
    SCOPED_TRACE(NoiseKindName(kind));
    const bool wrong =
        std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
    EXPECT_TRUE(result.noise_scales[At(kind)].determined());
    EXPECT_NEAR(FactorOf(result, kind) / (wrong ? off : 1), 1, 0.2);
  }
}

TEST(NoiseScales, AreOneIfTheRigIsRight) { ExpectFound({}, 1); }

TEST(NoiseScales, AScaleOfThreeOfThePixelsIsFound) {
  ExpectFound({NoiseKind::kPixel}, 3);
  ExpectFound({NoiseKind::kPixel}, 1.0 / 3);
}

TEST(NoiseScales, AScaleOfThreeOfTheGyroscopeIsFound) {
  ExpectFound({NoiseKind::kGyro}, 3);
  ExpectFound({NoiseKind::kGyro}, 1.0 / 3);
}

TEST(NoiseScales, AScaleOfThreeOfTheAccelerometerIsFound) {
  ExpectFound({NoiseKind::kAccel}, 3);
  ExpectFound({NoiseKind::kAccel}, 1.0 / 3);
}

TEST(NoiseScales, AScaleOfThreeOfAllIsFound) {
  const std::vector<NoiseKind> all = {
      NoiseKind::kPixel, NoiseKind::kGyro, NoiseKind::kAccel};
  ExpectFound(all, 3);
  ExpectFound(all, 1.0 / 3);
}

TEST(NoiseScales, ReweightingAppliesDeterminedScales) {
  const Rig truth = NoisyRig();
  const std::vector<MotionSegment> segments = Walk(truth, 2, 40, 80, 5);
  Rig believed = truth;
  ScaleNoise(NoiseKind::kPixel, 1.0 / 3, &believed);
  ScaleNoise(NoiseKind::kGyro, 3, &believed);
  const CalibrationResult result =
      Calibrate(believed, believed.factory, segments, {.reweight_noise = true});
  ASSERT_EQ(result.status, CalibrateStatus::kConverged);
  const CalibrationResult right =
      Calibrate(truth, truth.factory, segments, {.reweight_noise = true});
  ASSERT_EQ(right.status, CalibrateStatus::kConverged);
  // Scales are relative to the stated noise, and sigmas as if it were right.
  EXPECT_NEAR(FactorOf(result, NoiseKind::kPixel),
              3 * FactorOf(right, NoiseKind::kPixel),
              0.05 * 3);
  EXPECT_NEAR(FactorOf(result, NoiseKind::kGyro),
              FactorOf(right, NoiseKind::kGyro) / 3,
              0.1 / 3);
  for (const int i : FreeComponents(truth)) {
    EXPECT_NEAR(
        std::sqrt(result.covariance(i, i) / right.covariance(i, i)), 1, 0.1);
  }
}

// Errors of a tracker change slowly, and a part of them is common to a track:
// taken for independent ones, they would explain a part of what is the noise of
// the IMU, whose scales would be too small.
TEST(NoiseScales, OfTheImuAreRightWithTheErrorsOfATracker) {
  constexpr int kSeeds = 6;
  double gyro = 0, accel = 0;
  for (std::uint64_t seed = 3; seed < 3 + kSeeds; ++seed) {
    Rig rig = HandheldRig("r");
    rig.pixel_sigma_px = kTrackerSigma_px;
    SimulationOptions options;
    options.seed = seed;
    options.mean_track_length = 20;
    options.revisit_fraction = 0;
    UseTrackerErrors(&options);
    const std::vector<MotionSegment> segments =
        Simulate(rig,
                 rig.factory,
                 rig.factory,
                 *MakeHandheld(20.5, 1, seed),
                 "session",
                 options)
            .segments;
    rig.pixel_sigma_px = 0.5;
    const CalibrationResult result = CalibrateBelieving(rig, segments);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    for (const NoiseKind kind : {NoiseKind::kGyro, NoiseKind::kAccel}) {
      SCOPED_TRACE(NoiseKindName(kind));
      EXPECT_TRUE(result.noise_scales[At(kind)].determined());
      EXPECT_NEAR(FactorOf(result, kind), 1, 0.15);
    }
    gyro += FactorOf(result, NoiseKind::kGyro) / kSeeds;
    accel += FactorOf(result, NoiseKind::kAccel) / kSeeds;
  }
  // Four standard deviations of these means.
  EXPECT_NEAR(gyro, 1, 0.05);
  EXPECT_NEAR(accel, 1, 0.05);
}

// Pixels are weighted by no less than 0.05 px, however small their noise is,
// but a point that errs by as much has less weight than those that do not.
TEST(NoiseScales, PointsThatErrByMoreThanOthersHaveLessWeight) {
  constexpr int kSeeds = 4;
  double squares = 0, components = 0;
  for (std::uint64_t seed = 3; seed < 3 + kSeeds; ++seed) {
    Rig rig = HandheldRig("r");
    rig.pixel_sigma_px = 0.015;
    std::vector<MotionSegment> segments = Walk(rig, 3, 40, 100, seed);
    for (MotionSegment& segment : segments) {
      MoveOutwards(rig, 6 * rig.pixel_sigma_px, &segment);
    }
    rig.pixel_sigma_px = 0.5;
    const CalibrationResult result = CalibrateBelieving(rig, segments);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged);
    const Eigen::VectorXd error = BoxMinus(result.theta, rig.factory);
    for (const int i : FreeComponents(rig)) {
      squares += error(i) * error(i) / result.covariance(i, i);
      ++components;
    }
  }
  // The limit of 95 % for independent components.
  EXPECT_LT(squares, components + 1.96 * std::sqrt(2 * components));
}

// With the noise that the rig states, the data seems to say nothing about most
// directions.
TEST(NoiseScales, DirectionsHeldUnderTooMuchNoiseAreEstimatedAfterReweighting) {
  const Rig truth = NoisyRig();
  const std::vector<MotionSegment> segments = Walk(truth, 3, 40, 100, 3);
  Rig believed = truth;
  for (const NoiseKind kind : {NoiseKind::kGyro,
                               NoiseKind::kAccel,
                               NoiseKind::kGyroBiasWalk,
                               NoiseKind::kAccelBiasWalk}) {
    ScaleNoise(kind, 10, &believed);
  }
  const CalibrationResult stated = Calibrate(
      believed, believed.factory, segments, {.reweight_noise = false});
  const CalibrationResult result = CalibrateBelieving(believed, segments);
  const CalibrationResult right = CalibrateBelieving(truth, segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged);
  ASSERT_EQ(right.status, CalibrateStatus::kConverged);
  ASSERT_LT(stated.rank, right.rank);
  EXPECT_EQ(result.rank, right.rank);
}

TEST(NoiseScales, UndeterminedScalesAreReported) {
  const Rig rig = HandheldRig("r");
  const CalibrationResult result =
      CalibrateBelieving(rig, Walk(rig, 2, 40, 100, 4));
  ASSERT_EQ(result.noise_scales.size(), 5u);
  EXPECT_TRUE(result.noise_scales[At(NoiseKind::kPixel)].determined());
  for (const NoiseKind kind :
       {NoiseKind::kGyroBiasWalk, NoiseKind::kAccelBiasWalk}) {
    EXPECT_FALSE(result.noise_scales[At(kind)].determined());
    EXPECT_LT(result.noise_scales[At(kind)].redundancy, 5);
  }
}

}  // namespace
}  // namespace selfcal
