// Tests that errors match the claimed covariance: twenty simulated devices
// against truth.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// 95 % of the chi-square distribution with 26 degrees of freedom.
constexpr double kChiSquareLow = 13.844;
constexpr double kChiSquareHigh = 41.923;

TEST(Consistency, TwentyDevicesLieWithinTheirOwnSigmas) {
  int within_3_sigma = 0;
  int components = 0;
  int within_bounds = 0;
  double sum_nees = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Rig rig = HandheldRig("simulated");
    const Calibration truth = rig.factory;
    rig.factory = PerturbCalibration(truth, {}, seed);
    SimulationOptions options;
    options.seed = seed;
    const auto session = Simulate(
        rig, truth, rig.factory, *MakeMixed(25, seed), "session", options);
    ASSERT_EQ(session.segments.size(), 6u);
    const CalibrationResult result =
        Calibrate(rig, rig.factory, session.segments);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged)
        << "seed " << seed << ": " << result.message;

    const std::vector<int> free = FreeComponents(rig);
    const Eigen::VectorXd error = BoxMinus(result.theta, truth)(free);
    const Eigen::MatrixXd covariance = result.covariance(free, free);
    const double nees = error.dot(covariance.ldlt().solve(error));
    sum_nees += nees;
    within_bounds += nees > kChiSquareLow && nees < kChiSquareHigh;
    for (int i = 0; i < error.size(); ++i) {
      ++components;
      within_3_sigma += std::abs(error[i]) <= 3 * std::sqrt(covariance(i, i));
    }
    std::printf("seed %2d: %d iterations, NEES %.1f\n",
                static_cast<int>(seed),
                result.iterations,
                nees);
  }
  std::printf(
      "within 3 sigma: %d of %d; NEES within 95 %%: %d of 20, mean %.1f\n",
      within_3_sigma,
      components,
      within_bounds,
      sum_nees / 20);
  EXPECT_GE(within_3_sigma, 0.98 * components);
  EXPECT_GE(within_bounds, 17);
}

}  // namespace
}  // namespace selfcal
