#include "core/calibration/calibrate.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Tolerance of the difference of equal calibrations [rad]: with fused
// multiply-add (aarch64), the difference of a rotation to itself is not zero to
// the bit.
constexpr double kOfEqualRotations = 1e-15;

// A rig whose factory calibration is wrong, and segments of its motion.
struct Scenario {
  Rig rig;
  Calibration truth;
  std::vector<MotionSegment> segments;
};

SimulationOptions SmallOptions(std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 15;
  options.landmarks_in_view = 60;
  return options;
}

Scenario SimulatedScenario(const Rig& rig,
                           const SimulationOptions& options,
                           int segments) {
  Scenario s{rig, rig.factory, {}};
  // The same wrong factory calibration for every seed: one device.
  s.rig.factory = PerturbCalibration(s.truth, {}, 1);
  const double seconds =
      segments * options.keyframes_per_segment / options.keyframe_rate_hz + 0.5;
  s.segments = Simulate(s.rig,
                        s.truth,
                        s.rig.factory,
                        *MakeHandheld(seconds, 1.0, options.seed),
                        "session",
                        options)
                   .segments;
  return s;
}

// Components with variance: those that the rig does not hold fixed.
std::vector<int> Estimated(const CalibrationResult& result) {
  std::vector<int> components;
  for (int i = 0; i < result.covariance.rows(); ++i) {
    if (result.covariance(i, i) > 0) components.push_back(i);
  }
  return components;
}

// How far theta is from the truth in each component that is estimated, in
// sigmas of the result.
Eigen::VectorXd DistanceSigmas(const CalibrationResult& result,
                               const Calibration& theta,
                               const Calibration& truth) {
  const std::vector<int> at = Estimated(result);
  return BoxMinus(theta, truth)(at).cwiseAbs().array() /
         result.covariance.diagonal()(at).cwiseSqrt().array();
}

Eigen::VectorXd ErrorSigmas(const CalibrationResult& result,
                            const Calibration& truth) {
  return DistanceSigmas(result, result.theta, truth);
}

// Squared error of the whole vector in units of its covariance: chi-square
// distributed. 99.9 % of it lies below n + 3.09 sqrt(2 n) + 5.7
// (Cornish-Fisher).
void ExpectConsistent(const CalibrationResult& result,
                      const Calibration& truth) {
  const std::vector<int> free = Estimated(result);
  const Eigen::VectorXd error = BoxMinus(result.theta, truth)(free);
  const Eigen::MatrixXd covariance = result.covariance(free, free);
  const double n = static_cast<double>(error.size());
  EXPECT_LT(error.dot(covariance.ldlt().solve(error)),
            n + 3.09 * std::sqrt(2 * n) + 5.7);
}

TEST(Calibrate, WithoutNoiseFindsTheTruth) {
  SimulationOptions options = SmallOptions(1);
  options.noise = false;
  const Scenario s = SimulatedScenario(HandheldRig("r"), options, 4);
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_EQ(result.rank, 26);
  EXPECT_GT(DistanceSigmas(result, s.rig.factory, s.truth).maxCoeff(), 10)
      << "the start must be far away";
  EXPECT_LT(ErrorSigmas(result, s.truth).maxCoeff(), 0.02);
  EXPECT_LT(result.reprojection_rms_after_px, 0.002);
}

TEST(Calibrate, OrderOfSegmentsDoesNotMatter) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(2), 4);
  const CalibrationResult a = Calibrate(s.rig, s.rig.factory, s.segments);
  std::reverse(s.segments.begin(), s.segments.end());
  std::swap(s.segments[0], s.segments[2]);
  const CalibrationResult b = Calibrate(s.rig, s.rig.factory, s.segments);
  // Both from a third, see kOfEqualRotations.
  EXPECT_EQ(BoxMinus(a.theta, s.rig.factory), BoxMinus(b.theta, s.rig.factory));
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(Calibrate, SeveralSessionsAndGapsShareOnlyTheta) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(3), 6);
  s.segments.erase(s.segments.begin() + 2, s.segments.begin() + 4);
  Scenario other = SimulatedScenario(HandheldRig("r"), SmallOptions(4), 2);
  for (MotionSegment& segment : other.segments) {
    segment.key.session = "another";
    s.segments.push_back(segment);
  }
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_GE(result.partitions, 2);
  EXPECT_EQ(result.segments, 6);
  EXPECT_EQ(result.keyframes, 6 * 15);
  ExpectConsistent(result, s.truth);
}

TEST(Calibrate, TwoCamerasWithOtherDistortionModels) {
  Rig rig = HandheldRig("r");
  CameraCalibration second = rig.factory.cameras[0];
  second.model = DistortionModel::kRadialTangential;
  second.distortion.resize(4);
  second.distortion << -0.05, 0.01, 2e-4, -1e-4;
  second.f = {420, 421};
  second.p_CI += Eigen::Vector3d(0.08, 0.01, 0);
  second.q_CI = Exp(Eigen::Vector3d(0.05, -0.1, 0.02)) * second.q_CI;
  rig.factory.cameras.push_back(second);
  const Scenario s = SimulatedScenario(rig, SmallOptions(5), 4);
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  ASSERT_EQ(result.covariance.rows(), TangentSize(rig.factory));
  ExpectConsistent(result, s.truth);
}

TEST(Calibrate, OutliersAreExcluded) {
  SimulationOptions options = SmallOptions(6);
  options.outlier_fraction = 0.1;
  const Scenario s = SimulatedScenario(HandheldRig("r"), options, 5);
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_GT(result.observations_dropped, 0.08 * result.observations);
  ExpectConsistent(result, s.truth);
}

TEST(Calibrate, FixedComponentsStay) {
  Rig rig = HandheldRig("r");
  rig.fixed = {"imu.q_AI.*", "cam0.distortion.w"};
  const Scenario s = SimulatedScenario(rig, SmallOptions(7), 4);
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  const Eigen::VectorXd moved = BoxMinus(result.theta, s.rig.factory);
  for (const int i :
       MatchComponents(TangentComponents(rig.factory), rig.fixed)) {
    EXPECT_NEAR(moved[i], 0, 1e-12);
    EXPECT_EQ(result.covariance(i, i), 0);
  }
  EXPECT_EQ(result.rank, 22);
}

TEST(Calibrate, DeviceAtRestKeepsUnobservableParameters) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(8), 1);
  s.segments =
      Simulate(
          s.rig, s.truth, s.rig.factory, *MakeRest(6), "rest", SmallOptions(8))
          .segments;
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_NE(result.status, CalibrateStatus::kFailed) << result.message;
  EXPECT_TRUE(result.covariance.allFinite());
  EXPECT_FALSE(result.held_constant.empty());
  EXPECT_EQ(result.rank + static_cast<int>(result.held_constant.size()), 26);
  // The gyroscope's scale is unobservable: it keeps its prior.
  const Eigen::VectorXd prior = PriorSigmas(s.rig);
  for (int i = kGyroScale; i < kGyroScale + 6; ++i) {
    EXPECT_GT(std::sqrt(result.covariance(i, i)), 0.7 * prior[i]);
  }
}

TEST(Calibrate, CancelsImmediately) {
  const Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(9), 3);
  int calls = 0;
  const CalibrationResult result = Calibrate(
      s.rig, s.rig.factory, s.segments, {}, [&](const CalibrateProgress&) {
        return ++calls < 3;
      });
  EXPECT_EQ(result.status, CalibrateStatus::kCancelled);
  EXPECT_EQ(calls, 3);
}

TEST(Calibrate, ProgressReportsTheIterationsToTheResult) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(9), 3);
  s.rig.fixed = {"imu.gyro.scale.*"};
  // The scale is true: a parameter held at a wrong value makes segments
  // disagree.
  s.rig.factory.imu.s_g = s.truth.imu.s_g;
  std::vector<CalibrateProgress> told;
  const CalibrationResult result =
      Calibrate(s.rig,
                s.rig.factory,
                s.segments,
                {},
                [&](const CalibrateProgress& progress) {
                  told.push_back(progress);
                  return true;
                });
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  ASSERT_GT(told.size(), 2u);
  EXPECT_LT(told.front().moved.norm(), kOfEqualRotations);
  for (std::size_t i = 1; i < told.size(); ++i) {
    EXPECT_GE(told[i].iteration, told[i - 1].iteration);
  }
  const CalibrateProgress& last = told.back();
  EXPECT_LT(BoxMinus(last.theta, result.theta).norm(), kOfEqualRotations);
  EXPECT_EQ((last.moved - BoxMinus(result.theta, s.rig.factory)).norm(), 0);
  const Eigen::VectorXd sigmas = result.covariance.diagonal().cwiseSqrt();
  ASSERT_EQ(last.sigmas.size(), sigmas.size());
  for (int i = 0; i < sigmas.size(); ++i) {
    EXPECT_NEAR(last.sigmas[i], sigmas[i], 0.05 * sigmas[i]) << i;
  }
  EXPECT_EQ(last.sigmas.segment(kGyroScale, 3).norm(), 0);
}

// After reweighting, the calibration continues from its estimate: its
// iterations are counted on.
TEST(Calibrate, IterationsContinueWhenNoiseIsReweighted) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(12), 3);
  s.rig.pixel_sigma_px *= 3;
  std::vector<CalibrateProgress> told;
  const CalibrationResult result = Calibrate(
      s.rig, s.rig.factory, s.segments, {}, [&](const CalibrateProgress& at) {
        told.push_back(at);
        return true;
      });
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_LT(result.noise_scales[0].used, 0.5);
  EXPECT_EQ(told.back().iteration, result.iterations);
  int descents = 0;  // each reports its start, without a step
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_LE(told[i].iteration, told[i].max_iterations);
    EXPECT_GE(told[i].iteration, i > 0 ? told[i - 1].iteration : 0);
    descents += told[i].step_sigmas == 0;
  }
  EXPECT_GT(descents, 1);
}

// The noise that a calibration was weighted with is part of its result.
TEST(Calibrate, WronglyStatedNoiseIsReplacedAndReported) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(12), 3);
  s.rig.pixel_sigma_px /= 3;
  const CalibrationResult result = Calibrate(s.rig, s.rig.factory, s.segments);
  ASSERT_EQ(result.noise_scales.size(), static_cast<std::size_t>(kNoiseKinds));
  const NoiseScale& pixel = result.noise_scales.front();
  EXPECT_TRUE(pixel.converged);
  EXPECT_NEAR(pixel.factor, 3, 0.05 * 3);
  EXPECT_NEAR(pixel.used, 3, 0.05 * 3);
}

TEST(Calibrate, UnusableInputIsReportedWithTheReason) {
  const Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(10), 1);
  EXPECT_EQ(Calibrate(s.rig, s.rig.factory, {}).status,
            CalibrateStatus::kFailed);
  const CalibrationResult twice =
      Calibrate(s.rig, s.rig.factory, {s.segments[0], s.segments[0]});
  EXPECT_EQ(twice.status, CalibrateStatus::kFailed);
  EXPECT_NE(twice.message.find("given twice"), std::string::npos);
}

TEST(Calibrate, PriorPullsTowardsTheFactory) {
  Scenario s = SimulatedScenario(HandheldRig("r"), SmallOptions(11), 2);
  s.rig.prior_sigmas = {{"cam0.focal.*", 1e-3}};
  CalibrateOptions options;
  options.prior = FactoryPrior(s.rig);
  const CalibrationResult result =
      Calibrate(s.rig, s.truth, s.segments, options);
  const double f = s.rig.factory.cameras[0].f.x();
  EXPECT_NEAR(result.theta.cameras[0].f.x(), f, 0.01);
}

}  // namespace
}  // namespace selfcal
