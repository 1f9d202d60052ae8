// The same scene in images of another resolution: the same scores.
#include <gtest/gtest.h>

#include "core/information/segment_information.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// Quantities in pixels have other values; angles are unchanged.
void ScalePixels(double factor, Calibration* theta) {
  for (CameraCalibration& camera : theta->cameras) {
    camera.f *= factor;
    camera.c *= factor;
    camera.width_px = static_cast<int>(factor * camera.width_px);
    camera.height_px = static_cast<int>(factor * camera.height_px);
  }
}

TEST(Resolution, ScoresAreThoseOfTheSceneAtAnyResolution) {
  for (int seed = 1; seed <= 3; ++seed) {
    Rig rig = HandheldRig("a");
    rig.blocks = {{"*.time_offset", seed == 2}};
    rig.groups = DefaultGroups(rig.blocks);
    SimulationOptions options;
    options.seed = seed;
    const MotionSegment segment = Simulate(rig,
                                           rig.factory,
                                           rig.factory,
                                           *MakeHandheld(4.5, 0.5, seed),
                                           "session",
                                           options)
                                      .segments[0];
    const SegmentInformation expected = ScoreSegment(rig, rig.factory, segment);
    for (const double factor : {0.5, 2.0, 6.0}) {
      Rig other = rig;
      ScalePixels(factor, &other.factory);
      other.pixel_sigma_px *= factor;
      MotionSegment scaled = segment;
      for (Observation& seen : scaled.observations) seen.z_px *= factor;
      const SegmentInformation score =
          ScoreSegment(other, other.factory, scaled);
      ASSERT_EQ(score.groups.size(), expected.groups.size());
      EXPECT_EQ(score.residuals.inliers, expected.residuals.inliers);
      EXPECT_EQ(score.rank, expected.rank);
      for (std::size_t q = 0; q < score.groups.size(); ++q) {
        EXPECT_NEAR(score.groups[q].entropy, expected.groups[q].entropy, 1e-6)
            << expected.groups[q].group << " at " << factor;
        EXPECT_NEAR(score.groups[q].gain, expected.groups[q].gain, 1e-6);
        EXPECT_EQ(score.groups[q].rank, expected.groups[q].rank);
      }
    }
  }
}

}  // namespace
}  // namespace selfcal
