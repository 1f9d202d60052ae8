#include "core/calibration/screening.h"

#include <gtest/gtest.h>

#include <cmath>

#include "test/core/calibration/screened_session.h"

namespace selfcal {
namespace {

// A session with large pixel noise.
ScreenedSession NoisySession(std::uint64_t seed) {
  Rig rig = HandheldRig("r");
  rig.pixel_sigma_px = 2.4;
  SimulationOptions options;
  options.seed = seed;
  return {rig, *MakeHandheld(8.5, 1.0, seed), options};
}

// Calls visit(distance, inward, weight) for all used observations: the distance
// of the prediction from the nearest border, and how far inwards of it the
// observation is [pixel sigmas].
template <class Visitor>
void VisitUsed(const ScreenedSession& session, const Visitor& visit) {
  const LandmarkScene scene(session.rig.factory,
                            session.problem.keyframes,
                            session.motions,
                            session.rig.pixel_sigma_px);
  const CameraCalibration& camera = session.rig.factory.cameras[0];
  for (const ScreenedLandmark& landmark : session.screening.landmarks) {
    const Track& track = session.problem.tracks[landmark.track];
    for (const UsedObservation& used : landmark.used) {
      const TrackObservation& seen = track.observations[used.index];
      Eigen::Vector2d r_px;
      ASSERT_TRUE(scene.Residual(
          seen, landmark.position.Homogeneous(), &r_px, nullptr));
      const Eigen::Vector2d z_px = seen.z_px + r_px;
      const Eigen::Vector4d distances(z_px.x(),
                                      z_px.y(),
                                      camera.width_px - 1 - z_px.x(),
                                      camera.height_px - 1 - z_px.y());
      const Eigen::Vector4d inwards(-r_px.x(), -r_px.y(), r_px.x(), r_px.y());
      int border;
      distances.minCoeff(&border);
      visit(distances[border] / session.rig.pixel_sigma_px,
            inwards[border] / session.rig.pixel_sigma_px,
            used.weight);
    }
  }
}

// Pixels beyond the border are not observed: near the border only observations
// that noise moved inwards exist.
TEST(Screening, ObservationsUsedAtTheBorderAreNotBiasedInwards) {
  constexpr double kNear = 6;
  int near = 0;
  double sum = 0;
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    VisitUsed(NoisySession(seed),
              [&](double distance, double inward, double weight) {
                EXPECT_GT(distance, kBorderBegin);
                EXPECT_EQ(weight == 1, distance >= kBorderEnd);
                if (distance > kNear) return;
                ++near;
                sum += weight * inward;
                squares += weight * weight;
              });
  }
  ASSERT_GT(near, 1000);
  // A residual has less than one sigma.
  EXPECT_LT(std::abs(sum), 3 * std::sqrt(squares));
}

}  // namespace
}  // namespace selfcal
