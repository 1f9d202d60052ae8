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

}  // namespace
}  // namespace selfcal
