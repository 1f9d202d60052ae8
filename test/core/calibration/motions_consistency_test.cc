// Motions that do not observe all of theta: no claimed sigma is smaller than
// the error.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "test/core/information/simple_motions.h"

namespace selfcal {
namespace {

constexpr int kSeeds = 6;

struct Device {
  Rig rig;
  Calibration truth;
  std::vector<MotionSegment> segments;
};

Device SimulatedDevice(MotionKind kind, int seed) {
  std::mt19937 random(seed * 100 + static_cast<int>(kind));
  Device device{HandheldRig("simulated"), {}, {}};
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(device.truth, {}, seed);
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 20;
  options.landmarks_in_view = 80;
  device.segments = Simulate(device.rig,
                             device.truth,
                             device.rig.factory,
                             *RandomMotion(kind, 6.5, &random),
                             "session",
                             options)
                        .segments;
  return device;
}

class Motions : public testing::TestWithParam<MotionKind> {};

TEST_P(Motions, NoSigmaIsTooSmall) {
  double sum_nees = 0;
  int degrees = 0;
  int converged = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Device device = SimulatedDevice(GetParam(), seed);
    const CalibrationResult result =
        Calibrate(device.rig, device.rig.factory, device.segments);
    if (result.status != CalibrateStatus::kConverged) continue;
    ++converged;
    const std::vector<int> free = FreeComponents(device.rig);
    ASSERT_EQ(result.rank + result.held_constant.size(), free.size());
    const Eigen::VectorXd error = BoxMinus(result.theta, device.truth)(free);
    const Eigen::MatrixXd covariance = result.covariance(free, free);
    // Held directions have errors far below their prior, and add almost
    // nothing.
    sum_nees += error.dot(covariance.ldlt().solve(error));
    degrees += result.rank;
    for (int i = 0; i < error.size(); ++i) {
      EXPECT_LT(std::abs(error(i)), 5 * std::sqrt(covariance(i, i)))
          << "seed " << seed << ", "
          << TangentComponents(device.truth)[free[i]].name;
    }
  }
  std::printf("%d of %d converged, NEES %.1f of %d\n",
              converged,
              kSeeds,
              sum_nees,
              degrees);
  EXPECT_GE(converged, kSeeds - 1);
  // 99.9 % of the chi-square distribution, and what the curvature of weak
  // directions adds.
  EXPECT_LE(sum_nees, 1.2 * degrees + 3.1 * std::sqrt(2.0 * degrees) + 5);
}

INSTANTIATE_TEST_SUITE_P(All,
                         Motions,
                         testing::Values(MotionKind::kRest,
                                         MotionKind::kConstantVelocity,
                                         MotionKind::kOneAxis,
                                         MotionKind::kRotationOnly,
                                         MotionKind::kPlanar,
                                         MotionKind::kHover));

// The same device with images of twice the resolution: quantities in pixels
// have other values.
TEST(MotionsInOtherUnits, HeldDirectionsDoNotDependOnTheUnitOfPixels) {
  const Device device = SimulatedDevice(MotionKind::kPlanar, 2);
  Device finer = device;
  const auto scale = [](Calibration* theta) {
    for (CameraCalibration& camera : theta->cameras) {
      camera.f *= 2;
      camera.c *= 2;
      camera.width_px = 2 * camera.width_px - 1;
      camera.height_px = 2 * camera.height_px - 1;
    }
  };
  scale(&finer.rig.factory);
  finer.rig.pixel_sigma_px *= 2;
  const Eigen::VectorXd sigmas = PriorSigmas(device.rig);
  const auto components = TangentComponents(device.truth);
  for (std::size_t i = 0; i < components.size(); ++i) {
    if (components[i].unit == "px") {
      finer.rig.prior_sigmas.push_back(
          {components[i].name, 2 * sigmas(static_cast<int>(i))});
    }
  }
  for (MotionSegment& segment : finer.segments) {
    for (Observation& seen : segment.observations) seen.z_px *= 2;
  }
  const CalibrationResult a =
      Calibrate(device.rig, device.rig.factory, device.segments);
  const CalibrationResult b =
      Calibrate(finer.rig, finer.rig.factory, finer.segments);
  ASSERT_EQ(a.status, CalibrateStatus::kConverged);
  ASSERT_EQ(b.status, CalibrateStatus::kConverged);
  EXPECT_GT(a.held_constant.size(), 0u);
  ASSERT_EQ(a.held_constant.size(), b.held_constant.size());
  for (std::size_t i = 0; i < a.held_constant.size(); ++i) {
    EXPECT_EQ(a.held_constant[i].parts.front().component,
              b.held_constant[i].parts.front().component);
  }
  for (std::size_t i = 0; i < components.size(); ++i) {
    const int j = static_cast<int>(i);
    const double unit = components[i].unit == "px" ? 2 : 1;
    EXPECT_NEAR(std::sqrt(b.covariance(j, j)),
                unit * std::sqrt(a.covariance(j, j)),
                1e-3 * unit * std::sqrt(a.covariance(j, j)))
        << components[i].name;
  }
}

}  // namespace
}  // namespace selfcal
