// Tests that the estimate is right and errors match the claimed covariance, for
// a camera of each model; rays of the fish-eyes are beyond 90 degrees.
#include <gtest/gtest.h>

#include <cstdint>

#include "core/model/image_bounds.h"
#include "core/simulation/simulate.h"
#include "test/core/calibration/simulated_errors.h"
#include "test/core/model/each_model.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

class EachModel : public testing::TestWithParam<DistortionModel> {};

INSTANTIATE_TEST_SUITE_P(Models, EachModel, EachCameraModel(), CameraModelName);

// Directions in which these short sessions add nothing to what the factory
// states: numerator and denominator of the rational model nearly cancel, and xi
// acts as f and the distortion do.
int UndeterminedDirections(DistortionModel model) {
  if (DistortionName(model) == "radial-tangential-8") return 2;
  return DistortionName(model) == "unified" ? 1 : 0;
}

TEST_P(EachModel, IsFoundWithinItsSigmas) {
  const Calibration truth = LensRig(GetParam()).factory;
  ExpectConsistent(4, [&](std::uint64_t seed) {
    Rig rig = LensRig(GetParam());
    rig.factory = PerturbCalibration(truth, {}, seed);
    return CalibrateSimulated(
        rig, truth, seed, {80, UndeterminedDirections(GetParam())});
  });
}

// Each step of theta moves the end of the rays, and those of observations near
// it out of the model and back.
TEST(EndOfRays, WithinTheImageDoesNotKeepALensFromBeingFound) {
  int lenses = 0;
  for (const DistortionModel model : DistortionModels()) {
    Rig rig = LensRig(model);
    rig.factory.cameras[0].f *= 0.85;
    if (CoversImage(rig.factory.cameras[0], 0)) continue;
    SCOPED_TRACE(DistortionName(model));
    ++lenses;
    const Calibration truth = rig.factory;
    ExpectConsistent(4, [&](std::uint64_t seed) {
      rig.factory = PerturbCalibration(truth, {}, seed);
      return CalibrateSimulated(rig, truth, seed, {80});
    });
  }
  EXPECT_EQ(lenses, 2);
}

// xi, the focal lengths and the distortion describe nearly the same lens along
// a curve. They are held along its tangent; what the factory's error there does
// to the best determined of them exceeds their sigmas, without any noise.
TEST(UnifiedCamera, ClaimsTheErrorsOfACurveOfEquivalentLenses) {
  constexpr auto kUnified = static_cast<DistortionModel>(5);
  ASSERT_EQ(DistortionName(kUnified), "unified");
  const Calibration truth = LensRig(kUnified).factory;
  for (const double error : {-0.02, 0.02}) {
    Rig rig = LensRig(kUnified);
    CameraCalibration& camera = rig.factory.cameras[0];
    camera.f *= 1 + error;
    camera.distortion[0] *= 1 + error / 2;  // xi
    SimulationOptions options;
    options.seed = 1;
    options.noise = false;
    const SimulatedSession session = Simulate(
        rig, truth, rig.factory, *MakeHandheld(40.5, 1, 1), "s", options);
    const CalibrationResult result =
        Calibrate(rig, rig.factory, session.segments, {.noise_scales = false});
    ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
    ASSERT_EQ(result.held_constant.size(), 1u);
    const std::vector<int> free = FreeComponents(rig);
    const Errors errors{BoxMinus(result.theta, truth)(free),
                        result.covariance(free, free)};
    // Two errors that the covariance has, at 95 %: along the tangent, and the
    // bend.
    EXPECT_LT(errors.Nees(), 5.99) << "factory off by " << error;
  }
}

}  // namespace
}  // namespace selfcal
