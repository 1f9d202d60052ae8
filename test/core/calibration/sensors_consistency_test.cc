// Tests that the estimate is right and errors match the claimed covariance, for
// rigs of several cameras with time offsets and some known parameters.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/model/symmetric_eigen.h"
#include "core/model/temperature.h"
#include "core/simulation/simulate.h"
#include "test/core/calibration/simulated_errors.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

using ::testing::ElementsAre;

// Time offsets of the cameras in truth; the factory believes in none.
constexpr double kTimeOffsets_s[] = {0.02, -0.015, 0.008, -0.003};

Rig LateRig(int cameras) {
  Rig rig = RigOfCameras(cameras);
  for (int j = 0; j < cameras; ++j) {
    rig.factory.cameras[j].time_offset_s = kTimeOffsets_s[j];
  }
  return rig;
}

// Expects the last component, which is estimated from nothing, within 3.3 sigma
// and known better than this.
void ExpectLastIsFound(const Errors& errors, double largest_sigma) {
  const auto last = errors.error.size() - 1;
  const double sigma = std::sqrt(errors.covariance(last, last));
  std::printf("last: %.2g off, sigma %.2g\n", errors.error(last), sigma);
  EXPECT_LT(std::abs(errors.error(last)), 3.3 * sigma);
  EXPECT_LT(sigma, largest_sigma);
}

Rig RigOfTwoImus() {
  Rig rig = HandheldRig("two_imus");
  AddSecondImu(&rig);
  return rig;
}

TEST(TwoImus, AreFoundWithinTheirSigmas) {
  const Rig rig = RigOfTwoImus();
  ExpectConsistent(12, [&](std::uint64_t seed) {
    Rig wrong = rig;
    wrong.factory = PerturbCalibration(rig.factory, {}, seed);
    return CalibrateSimulated(wrong, rig.factory, seed);
  });
}

TEST(TwoImus, TheTimeOffsetOfTheSecondOneIsFound) {
  const Rig rig = RigOfTwoImus();
  Calibration truth = rig.factory;
  truth.imu1->time_offset_s = 4e-3;
  const int offset = LinkTangentSize(truth) - 1;
  ExpectConsistent(6, [&](std::uint64_t seed) {
    Rig wrong = rig;
    wrong.factory = PerturbCalibration(rig.factory, {}, seed);
    wrong.blocks = {{"imu1.time_offset", true}};
    wrong.groups = DefaultGroups(wrong.blocks, wrong.factory);
    const Errors errors = CalibrateSimulated(wrong, truth, seed);
    const double sigma = std::sqrt(errors.covariance(offset, offset));
    std::printf(
        "time offset: %.2g off, sigma %.2g\n", errors.error(offset), sigma);
    EXPECT_LT(std::abs(errors.error(offset)), 3.5 * sigma);
    EXPECT_LT(sigma, 2e-5);
    return errors;
  });
}

TEST(TwoImus, TheSecondOneOnlyAddsInformation) {
  const Rig two = RigOfTwoImus();
  Rig one = two;
  one.factory.imu1.reset();
  one.groups = DefaultGroups(one.blocks, one.factory);
  MotionSegment segment =
      Simulate(two, two.factory, two.factory, *MakeHandheld(4.5, 1, 1), "s", {})
          .segments.front();
  // Eliminates its own components, of which the rig knows the prior.
  Eigen::MatrixXd with = ScoreSegment(two, two.factory, segment).Lambda;
  with.diagonal() += PriorSigmas(two).cwiseAbs2().cwiseInverse();
  const auto components = TangentComponents(two.factory);
  const auto common = MatchComponents(components, {"imu.*", "cam0.*"});
  const auto second = MatchComponents(components, {"imu1.*"});
  const Eigen::MatrixXd coupling = with(second, common);
  Eigen::MatrixXd added =
      with(common, common) -
      coupling.transpose() * with(second, second).ldlt().solve(coupling);
  segment.imu1.clear();
  Eigen::MatrixXd without = ScoreSegment(one, one.factory, segment).Lambda;
  const Eigen::VectorXd prior = PriorSigmas(one);
  without.diagonal() += prior.cwiseAbs2().cwiseInverse();
  added = prior.asDiagonal() * (added - without) * prior.asDiagonal();
  without = prior.asDiagonal() * without * prior.asDiagonal();
  const Eigen::VectorXd eigenvalues = SymmetricEigenvalues(added);
  EXPECT_GT(eigenvalues.minCoeff(), -1e-9 * without.norm());
  EXPECT_GT(eigenvalues.maxCoeff(), 1);
}

// The second IMU is noisier than its rig states; the calibration notices, and
// weights it by less.
TEST(TwoImus, TheNoiseOfTheSecondOneIsEstimated) {
  Rig rig = RigOfTwoImus();
  SimulationOptions options;
  options.seed = 3;
  options.keyframes_per_segment = 30;
  const std::vector<MotionSegment> segments =
      Simulate(rig,
               rig.factory,
               PerturbCalibration(rig.factory, {}, 3),
               *MakeHandheld(12.5, 1, 3),
               "s",
               options)
          .segments;
  rig.imu1_noise.gyro_noise_density /= 4;
  rig.imu1_noise.accel_noise_density /= 4;
  const CalibrationResult result = Calibrate(rig, rig.factory, segments);
  ASSERT_EQ(result.noise_scales.size(),
            static_cast<std::size_t>(kMaxNoiseKinds));
  for (const NoiseScale& scale : result.noise_scales) {
    const bool wrong = scale.kind == NoiseKind::kSecondGyro ||
                       scale.kind == NoiseKind::kSecondAccel;
    std::printf("%s: %.2f, used %.2f\n",
                NoiseKindName(scale.kind).c_str(),
                scale.factor,
                scale.used);
    if (wrong) {
      EXPECT_LT(std::abs(std::log(scale.factor / 4)), 3.3 * scale.log_sigma);
      EXPECT_GT(scale.used, 3);
    } else {
      EXPECT_LT(std::abs(std::log(scale.factor)), 3.3 * scale.log_sigma);
    }
  }
}

class Cameras : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Rigs, Cameras, testing::Values(1, 2, 4));

TEST_P(Cameras, OfKnownTimeOffsetsAreFoundWithinTheirSigmas) {
  const Calibration truth = LateRig(GetParam()).factory;
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = LateRig(GetParam());
    rig.factory = PerturbCalibration(truth, {}, seed);
    return CalibrateSimulated(rig, truth, seed);
  });
}

TEST_P(Cameras, AreFoundWithTheirTimeOffsets) {
  const Calibration truth = LateRig(GetParam()).factory;
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(GetParam());
    rig.factory = PerturbCalibration(rig.factory, {}, seed);
    rig.blocks = {{"*.time_offset", true}};
    rig.groups = DefaultGroups(rig.blocks);
    const Errors errors = CalibrateSimulated(rig, truth, seed);
    const std::vector<int> free = FreeComponents(rig);
    for (int j = 0; j < GetParam(); ++j) {
      const int at = static_cast<int>(
          std::find(free.begin(), free.end(), TimeOffsetComponent(truth, j)) -
          free.begin());
      const double sigma = std::sqrt(errors.covariance(at, at));
      EXPECT_LT(std::abs(errors.error(at)), 3.3 * sigma);
      EXPECT_LT(sigma, 5e-4);
    }
    return errors;
  });
}

// Readouts of 10, 20 and 33 ms: of a rig that knows them, and of one that
// believes that all rows are exposed at once.
class RollingShutter : public testing::TestWithParam<int> {
 protected:
  static Calibration Truth() {
    Calibration truth = RigOfCameras(1).factory;
    truth.cameras[0].line_delay_s =
        1e-3 * GetParam() / truth.cameras[0].height_px;
    return truth;
  }
};

INSTANTIATE_TEST_SUITE_P(Readouts, RollingShutter, testing::Values(10, 20, 33));

TEST_P(RollingShutter, OfAKnownLineDelayIsFoundWithinItsSigmas) {
  const Calibration truth = Truth();
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.factory = PerturbCalibration(truth, {}, seed);
    rig.blocks = {{"*.line_delay", false}};
    return CalibrateSimulated(rig, truth, seed);
  });
}

TEST_P(RollingShutter, IsFoundWithItsLineDelay) {
  const Calibration truth = Truth();
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.factory.cameras[0].line_delay_s = 0;
    rig.factory = PerturbCalibration(rig.factory, {}, seed);
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    const Errors errors = CalibrateSimulated(rig, truth, seed);
    ExpectLastIsFound(errors, 1e-6);
    return errors;
  });
}

// Drifts of 20 and 100 parts in a million, of a rig that believes in none: five
// minutes after the session began, clocks are 6 and 30 ms apart.
class Drifts : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(ClockDrift, Drifts, testing::Values(20, -100));

TEST_P(Drifts, AreFoundWithTheTimeOffset) {
  Calibration truth = RigOfCameras(1).factory;
  truth.cameras[0].time_offset_s = 0.004;
  truth.cameras[0].time_drift = 1e-6 * GetParam();
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.factory.cameras[0].time_drift = 0;
    rig.factory = PerturbCalibration(rig.factory, {}, seed);
    rig.blocks = {{"*.time_offset", true}};
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    const Errors errors =
        CalibrateSimulated(rig, truth, seed, {.apart_s = 100});
    ExpectLastIsFound(errors, 2e-6);
    return errors;
  });
}

// Segments of 12 s that all show an offset of 30 ms.
TEST(ClockDrift, InAShortSessionIsKnownAsWellAsIsClaimed) {
  Calibration truth = RigOfCameras(1).factory;
  truth.cameras[0].time_offset_s = 0.03;
  truth.cameras[0].time_drift = 0;
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.factory.cameras[0].time_drift = 0;
    rig.factory = PerturbCalibration(rig.factory, {}, seed);
    rig.blocks = {{"*.time_offset", true}};
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    return CalibrateSimulated(rig, truth, seed);
  });
}

// A device at -5 to 55 degrees, whose scales, focal lengths and extrinsics vary
// with temperature.
const std::vector<double> kTemperatures_c = {-5, 15, 35, 55};

std::vector<BlockSetting> EstimatedSlopes(bool estimated) {
  return {{"imu.gyro.scale_slope", estimated},
          {"imu.accel.scale_slope", estimated},
          {"*.q_CI_slope", estimated},
          {"*.focal_slope", estimated}};
}

TEST(Temperature, OfKnownSlopesEverythingIsFoundWithinItsSigmas) {
  const Calibration truth = WithSlopes(RigOfCameras(2).factory);
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(2);
    rig.factory = PerturbCalibration(truth, {}, seed);
    rig.blocks = EstimatedSlopes(false);
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    return CalibrateSimulated(
        rig, truth, seed, {.temperatures_c = kTemperatures_c});
  });
}

TEST(Temperature, SlopesAreFoundWithTheRest) {
  const Calibration truth = WithSlopes(RigOfCameras(1).factory);
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.factory = PerturbCalibration(WithZeroSlopes(rig.factory), {}, seed);
    rig.blocks = EstimatedSlopes(true);
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    const Errors errors = CalibrateSimulated(
        rig, truth, seed, {.temperatures_c = kTemperatures_c});
    ExpectLastIsFound(errors, 0.5 * truth.cameras[0].f_slope.y());
    return errors;
  });
}

TEST(Temperature, SlopesOfDistortionAndTimeOffsetAreFound) {
  const Calibration device = RigOfCameras(1).factory;
  Calibration truth = device;
  truth.cameras[0].distortion_slope = 2e-4 * device.cameras[0].distortion;
  truth.cameras[0].time_offset_slope.setConstant(1, 3e-5);
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = RigOfCameras(1);
    rig.blocks = {{"*.time_offset", true},
                  {"*.distortion_slope", true},
                  {"*.time_offset_slope", true}};
    AddEstimatedBlocks(rig.blocks, &rig.factory);
    rig.factory = PerturbCalibration(rig.factory, {}, seed);
    rig.prior_sigmas = {{"*.distortion_slope.*", 2e-4},
                        {"*.time_offset_slope", 3e-5}};
    rig.groups = DefaultGroups(rig.blocks, rig.factory);
    const Errors errors = CalibrateSimulated(
        rig, truth, seed, {.temperatures_c = kTemperatures_c});
    ExpectLastIsFound(errors, 0.5 * truth.cameras[0].time_offset_slope[0]);
    return errors;
  });
}

// Segments of one temperature say nothing about slopes, and the rest is that at
// this temperature.
TEST(Temperature, OfOneTemperatureTheValuesThereAreFound) {
  const Calibration truth = WithSlopes(RigOfCameras(1).factory);
  constexpr double kWarm_c = 45;
  SimulationOptions options;
  options.keyframes_per_segment = 30;
  options.landmarks_in_view = 60;
  Rig rig = RigOfCameras(1);
  rig.factory = PerturbCalibration(WithZeroSlopes(rig.factory), {}, 7);
  rig.blocks = EstimatedSlopes(true);
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  const CalibrationResult result =
      Calibrate(rig,
                rig.factory,
                SimulateAtTemperatures(
                    rig, truth, {kWarm_c, kWarm_c, kWarm_c, kWarm_c}, options));
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  const Eigen::VectorXd error = BoxMinus(AtTemperature(result.theta, kWarm_c),
                                         AtTemperature(truth, kWarm_c));
  const Eigen::MatrixXd by_theta = TemperatureDerivative(result.theta, kWarm_c);
  const Eigen::VectorXd there =
      (by_theta * result.covariance * by_theta.transpose())
          .diagonal()
          .cwiseSqrt();
  const Eigen::VectorXd reference = result.covariance.diagonal().cwiseSqrt();
  for (int i = 0; i < error.size(); ++i) {
    EXPECT_LE(std::abs(error(i)), 4 * there(i)) << i;
  }
  // 20 K away, the unknown slope counts.
  const int focal = CameraTangentOffset(truth, 0) + kCameraIntrinsics;
  EXPECT_LT(there(focal), 0.5 * reference(focal));
}

// Other parameters of the same rig are known equally well, and estimated as
// well.
TEST(FreeParameters, AreThoseThatTheRigChooses) {
  Rig chosen = LateRig(2);
  chosen.fixed = {"imu.*", "cam0.p_CI.*"};
  chosen.groups.erase(chosen.groups.begin());  // imu
  const Calibration truth = chosen.factory;
  const std::vector<int> free = FreeComponents(chosen);
  EXPECT_EQ(static_cast<int>(free.size()), (6 + 5 - 3) + (6 + 8));
  ASSERT_THAT(Validate(chosen), testing::IsEmpty());
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = chosen;
    rig.factory.cameras = PerturbCalibration(truth, {}, seed).cameras;
    rig.factory.cameras[0].p_CI = truth.cameras[0].p_CI;
    return CalibrateSimulated(rig, truth, seed);
  });
}

TEST(Groups, OfFourCamerasHaveAllTheirParts) {
  Rig rig = LateRig(4);
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks);
  SimulationOptions options;
  options.landmarks_in_view = 60;
  const SimulatedSession session = Simulate(
      rig, rig.factory, rig.factory, *MakeHandheld(4.5, 1, 1), "s", options);
  const SegmentInformation score =
      ScoreSegment(rig, rig.factory, session.segments.front());
  std::vector<std::string> names;
  std::vector<int> sizes;
  for (const GroupScore& group : score.groups) {
    names.push_back(group.group);
    sizes.push_back(group.size);
    EXPECT_GT(group.gain, 1) << group.group;
    EXPECT_TRUE(std::isfinite(group.entropy)) << group.group;
  }
  EXPECT_THAT(names, ElementsAre("imu", "camera", "extrinsics", "time"));
  // FOV 1, equidistant 4, radial-tangential 4, FOV 1.
  EXPECT_THAT(sizes, ElementsAre(15, 4 * 4 + 10, 4 * 6, 4));
  EXPECT_EQ(score.rank, 15 + 26 + 24 + 4);
}

// A rig with a wrong value of gravity has the difference in the scale of its
// accelerometer, far beyond its sigma.
TEST(Gravity, IsTheScaleOfTheAccelerometer) {
  Rig rig = HandheldRig("r");
  const Calibration truth = rig.factory;
  rig.gravity_mps2 = 9.83;
  SimulationOptions options;
  const SimulatedSession session =
      Simulate(rig, truth, truth, *MakeHandheld(32.5, 1, 1), "s", options);
  const auto scales = [&](double gravity_mps2) {
    Rig believed = rig;
    believed.gravity_mps2 = gravity_mps2;
    return Calibrate(believed, truth, session.segments);
  };
  const CalibrationResult right = scales(9.83);
  const CalibrationResult wrong = scales(9.78);
  ASSERT_EQ(right.status, CalibrateStatus::kConverged);
  ASSERT_EQ(wrong.status, CalibrateStatus::kConverged);
  const double expected = 9.83 / 9.78 - 1;
  for (int i = 0; i < 3; ++i) {
    const double sigma =
        std::sqrt(right.covariance(kAccelScale + i, kAccelScale + i));
    EXPECT_LT(std::abs(right.theta.imu.s_a[i] - truth.imu.s_a[i]), 3 * sigma);
    EXPECT_GT(wrong.theta.imu.s_a[i] - right.theta.imu.s_a[i], 5 * sigma);
    EXPECT_NEAR(wrong.theta.imu.s_a[i] / right.theta.imu.s_a[i] - 1,
                expected,
                0.1 * expected);
  }
}

}  // namespace
}  // namespace selfcal
