// Tests that the g-sensitivity of a gyroscope and the positions of an
// accelerometer's axes are estimated within what the covariance claims, and
// that an estimate which ignores positions is not. (One that ignores the
// g-sensitivity of these devices is: its effect is below the noise of so short
// a session, NEES 97 of 104.) Where nothing defines the origin of the body, its
// shift is held constant.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "core/model/symmetric_eigen.h"
#include "core/simulation/simulate.h"
#include "test/core/calibration/simulated_errors.h"

namespace selfcal {
namespace {

constexpr int kDevices = 25;

struct CoupledCase {
  std::string name;
  // Half of the range of the true values: of a poor gyroscope, and of an
  // accelerometer at the other end of a circuit board.
  double g_sensitivity = 0;  // [rad/s per m/s^2]
  double position_m = 0;
  int positions = 0;
  std::vector<std::string> fixed = {};  // at its true value
};

// The position of an accelerometer and those of the cameras are relative to the
// origin of the body, which is free: some of them define it.
std::vector<CoupledCase> Cases() {
  return {
      {.name = "g_sensitivity", .g_sensitivity = 5e-4},
      {.name = "position",
       .position_m = 0.05,
       .positions = 3,
       .fixed = {"cam0.p_CI.*"}},
      {.name = "position_of_each_axis",
       .position_m = 0.05,
       .positions = 9,
       .fixed = {"imu.accel.position.x.*"}},
      {.name = "both",
       .g_sensitivity = 5e-4,
       .position_m = 0.05,
       .positions = 9,
       .fixed = {"imu.accel.position.x.*"}},
  };
}

Calibration TrueCalibration(const CoupledCase& of, std::uint64_t seed) {
  Calibration truth = HandheldRig("coupled").factory;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto fill = [&](int size, double range, OptionalVector* value) {
    value->resize(size);
    for (double& x : *value) x = range * uniform(random);
  };
  if (of.g_sensitivity > 0) {
    fill(9, of.g_sensitivity, &truth.imu.gyro_g_sensitivity);
  }
  fill(of.positions, of.position_m, &truth.imu.accel_position);
  return truth;
}

class Coupled : public testing::TestWithParam<CoupledCase> {};

INSTANTIATE_TEST_SUITE_P(Imus,
                         Coupled,
                         testing::ValuesIn(Cases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Coupled, IsFoundWithinItsSigmas) {
  const CoupledCase& of = GetParam();
  ExpectConsistent(kDevices, [&](std::uint64_t seed) {
    const Calibration truth = TrueCalibration(of, seed);
    Rig rig = HandheldRig("coupled");
    rig.factory = PerturbCalibration(truth, {}, seed);
    rig.factory.imu.gyro_g_sensitivity.setZero();
    rig.factory.imu.accel_position.setZero();
    // The fixed part is known.
    if (of.positions == 3) {
      rig.factory.cameras[0].p_CI = truth.cameras[0].p_CI;
    } else if (of.positions == 9) {
      rig.factory.imu.accel_position.head<3>() =
          truth.imu.accel_position.head<3>();
    }
    rig.blocks = {{"imu.gyro.g_sensitivity", true},
                  {"imu.accel.position", true}};
    rig.fixed = of.fixed;
    return CalibrateSimulated(rig, truth, seed);
  });
}

// Errors along the estimated directions alone, in sigmas of the prior. What is
// held has at least the variance of the prior, and comes last.
Errors AlongEstimated(const Rig& rig,
                      const Calibration& truth,
                      const CalibrationResult& result) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = PriorSigmas(rig)(free);
  const Eigen::VectorXd scale = sigmas.cwiseInverse();
  const Eigen::VectorXd error = BoxMinus(result.theta, truth)(free);
  const SymmetricEigen eigen(
      scale.asDiagonal() * result.covariance(free, free) * scale.asDiagonal());
  const Eigen::MatrixXd estimated = eigen.eigenvectors().leftCols(result.rank);
  return {estimated.transpose() * scale.cwiseProduct(error),
          eigen.eigenvalues().head(result.rank).asDiagonal()};
}

// A common shift along three axes, of nothing but what is relative to the
// origin.
void ExpectOriginHeld(const std::vector<UnobservedDirection>& held) {
  EXPECT_EQ(held.size(), 3u);
  for (const UnobservedDirection& direction : held) {
    EXPECT_FALSE(direction.parts.empty());
    for (const UnobservedDirection::Part& part : direction.parts) {
      EXPECT_TRUE(part.component.starts_with("imu.accel.position.") ||
                  part.component.starts_with("cam0.p_CI."))
          << part.component;
    }
  }
}

TEST(CoupledWithoutAnOrigin, HoldsItsShiftAndFindsTheRestWithinItsSigmas) {
  const CoupledCase of = {
      .name = "no_origin", .position_m = 0.05, .positions = 9};
  ExpectConsistent(kDevices, [&](std::uint64_t seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Calibration truth = TrueCalibration(of, seed);
    Rig rig = HandheldRig("coupled");
    rig.factory = PerturbCalibration(truth, {}, seed);
    rig.factory.imu.accel_position.setZero();
    rig.blocks = {{"imu.accel.position", true}};
    SimulationOptions options;
    options.seed = seed;
    options.landmarks_in_view = 60;
    options.keyframes_per_segment = 30;
    const CalibrationResult result =
        Calibrate(rig, rig.factory, SimulateKind(rig, truth, options, {}));
    EXPECT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
    EXPECT_EQ(result.rank + 3, static_cast<int>(FreeComponents(rig).size()));
    ExpectOriginHeld(result.held_constant);
    return AlongEstimated(rig, truth, result);
  });
}

std::vector<CoupledCase> CasesWithPositions() {
  std::vector<CoupledCase> cases = Cases();
  std::erase_if(cases, [](const CoupledCase& of) { return of.positions == 0; });
  return cases;
}

class IgnoredPositions : public testing::TestWithParam<CoupledCase> {};

INSTANTIATE_TEST_SUITE_P(Imus,
                         IgnoredPositions,
                         testing::ValuesIn(CasesWithPositions()),
                         [](const auto& info) { return info.param.name; });

TEST_P(IgnoredPositions, BiasOtherParameters) {
  const CoupledCase& of = GetParam();
  double nees = 0;
  int components = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Calibration truth = TrueCalibration(of, seed);
    Calibration rest = truth;
    rest.imu.gyro_g_sensitivity.resize(0);
    rest.imu.accel_position.resize(0);
    Rig rig = HandheldRig("coupled");
    rig.factory = PerturbCalibration(rest, {}, seed);
    const Errors errors = CalibrateSimulated(rig, truth, rest, seed);
    nees += errors.Nees();
    components += static_cast<int>(errors.error.size());
  }
  std::printf(
      "%s ignored: NEES %.0f of %d\n", of.name.c_str(), nees, components);
  EXPECT_GT(nees, 2 * components);
}

}  // namespace
}  // namespace selfcal
