#include "core/calibration/screening.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/calibration/partition.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

// A session with large pixel noise, screened at its true states.
class ScreenedSession {
 public:
  explicit ScreenedSession(std::uint64_t seed) : rig_(NoisyRig()) {
    SimulationOptions options;
    options.seed = seed;
    session_ = Simulate(rig_,
                        rig_.factory,
                        rig_.factory,
                        *MakeHandheld(8.5, 1.0, seed),
                        "session",
                        options);
    for (std::size_t s = 0; s < session_.segments.size(); ++s) {
      session_.segments[s].keyframes = session_.truth[s].keyframes;
    }
    const std::vector<const MotionSegment*> sorted =
        SortByKey(session_.segments);
    problem_ = FlattenSegments(rig_, sorted, PartitionSegments(sorted, 15));
    MeasureMotions(
        rig_, rig_.factory, problem_, problem_.keyframes, &motions_);
    screening_ = ScreenLandmarks(rig_,
                                 rig_.factory,
                                 problem_,
                                 problem_.keyframes,
                                 motions_,
                                 {},
                                 nullptr);
  }

  // Calls visit(distance, inward, weight) for all that is used: how far inside
  // the nearest border the prediction lies, and how far inwards of that the
  // observation [pixel sigmas].
  template <class Visitor>
  void VisitUsed(const Visitor& visit) const {
    const LandmarkScene scene(
        rig_.factory, problem_.keyframes, motions_, rig_.pixel_sigma_px);
    const CameraCalibration& camera = rig_.factory.cameras[0];
    for (const ScreenedLandmark& landmark : screening_.landmarks) {
      const Track& track = problem_.tracks[landmark.track];
      for (const UsedObservation& used : landmark.used) {
        const TrackObservation& seen = track.observations[used.index];
        Eigen::Vector2d r_px;
        ASSERT_TRUE(
            scene.Residual(seen, landmark.place.Homogeneous(), &r_px, nullptr));
        const Eigen::Vector2d z_px = seen.z_px + r_px;
        const Eigen::Vector4d distances(z_px.x(),
                                        z_px.y(),
                                        camera.width_px - 1 - z_px.x(),
                                        camera.height_px - 1 - z_px.y());
        const Eigen::Vector4d inwards(-r_px.x(), -r_px.y(), r_px.x(), r_px.y());
        int border;
        distances.minCoeff(&border);
        visit(distances[border] / rig_.pixel_sigma_px,
              inwards[border] / rig_.pixel_sigma_px,
              used.weight);
      }
    }
  }

 private:
  static Rig NoisyRig() {
    Rig rig = HandheldRig("r");
    rig.pixel_sigma_px = 2.4;
    return rig;
  }

  Rig rig_;
  SimulatedSession session_;
  CalibrationProblem problem_;
  KeyframeMotions motions_;
  Screening screening_;
};

// Pixels beyond the border are not seen: of what is predicted near it, only
// what noise moved inwards is there.
TEST(Screening, WhatIsUsedAtTheBorderDoesNotLeanInwards) {
  constexpr double kNear = 6;
  int near = 0;
  double sum = 0;
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    ScreenedSession(seed).VisitUsed(
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
