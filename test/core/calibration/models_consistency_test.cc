// Tests that the estimate is right and errors match the claimed covariance, for
// a camera of each model; rays of the fish-eyes are beyond 90 degrees.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/camera_model.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

class EachModel : public testing::TestWithParam<DistortionModel> {};

INSTANTIATE_TEST_SUITE_P(Models,
                         EachModel,
                         testing::ValuesIn(DistortionModels().begin(),
                                           DistortionModels().end()),
                         [](const auto& info) {
                           std::string name(DistortionName(info.param));
                           std::erase(name, '-');
                           return name;
                         });

// Directions in which these short sessions add nothing to what the factory
// states: numerator and denominator of the rational model nearly cancel, and xi
// acts as f and the distortion do.
int UndeterminedDirections(DistortionModel model) {
  if (DistortionName(model) == "radial-tangential-8") return 2;
  return DistortionName(model) == "unified" ? 1 : 0;
}

// The sum of NEES of some devices is within 99.9 % of its chi-square
// distribution (Wilson and Hilferty), and errors are within 3 sigma as often as
// normal ones.
TEST_P(EachModel, IsFoundWithinItsSigmas) {
  constexpr int kDevices = 4;
  double nees = 0;
  int components = 0, within = 0;
  for (std::uint64_t seed = 1; seed <= kDevices; ++seed) {
    Rig rig = LensRig(GetParam());
    const Calibration truth = rig.factory;
    rig.factory = PerturbCalibration(truth, {}, seed);
    SimulationOptions options;
    options.seed = seed;
    options.landmarks_in_view = 80;
    options.keyframes_per_segment = 30;
    const SimulatedSession session = Simulate(
        rig, truth, rig.factory, *MakeHandheld(12.5, 1, seed), "s", options);
    ASSERT_EQ(session.segments.size(), 4u);
    const CalibrationResult result =
        Calibrate(rig, rig.factory, session.segments);
    ASSERT_EQ(result.status, CalibrateStatus::kConverged)
        << "seed " << seed << ": " << result.message;
    const std::vector<int> free = FreeComponents(rig);
    EXPECT_EQ(
        result.rank,
        static_cast<int>(free.size()) - UndeterminedDirections(GetParam()));
    const Eigen::VectorXd error = BoxMinus(result.theta, truth)(free);
    const Eigen::MatrixXd covariance = result.covariance(free, free);
    const double of_device = error.dot(covariance.ldlt().solve(error));
    std::printf("seed %d: NEES %.1f of %d\n",
                static_cast<int>(seed),
                of_device,
                static_cast<int>(error.size()));
    nees += of_device;
    components += static_cast<int>(error.size());
    within += static_cast<int>((error.cwiseAbs().array() <=
                                3 * covariance.diagonal().cwiseSqrt().array())
                                   .count());
  }
  const double n = components;
  const auto quantile = [&](double z) {
    return n * std::pow(1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n)), 3);
  };
  EXPECT_GT(nees, quantile(-3.29));
  EXPECT_LT(nees, quantile(3.29));
  EXPECT_GE(within, 0.985 * components);
}

}  // namespace
}  // namespace selfcal
