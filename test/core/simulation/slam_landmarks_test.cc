#include "core/simulation/slam_landmarks.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/simulation/random.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

// A camera that translates sideways by 1 m and observes points 2 to 4 m ahead.
struct Scene {
  Rig rig = HandheldRig("a");
  std::vector<KeyframeState> states;
  FeatureTracks tracks;

  explicit Scene(double pixel_noise_px) {
    Random random(1, 0);
    for (int k = 0; k < 11; ++k) {
      KeyframeState state;
      state.p_GI = {0, 0.1 * k - 0.5, 0};
      states.push_back(state);
    }
    const CameraCalibration& camera = rig.factory.cameras[0];
    for (int m = 0; m < 300; ++m) {
      const double x = random.Uniform(2, 4);
      const double y = random.Uniform(-1, 1);
      const double z = random.Uniform(-1, 1);
      tracks.landmarks_G.emplace_back(x, y, z);
      for (int k = 0; k < 11; ++k) {
        FeatureObservation observation;
        observation.keyframe = k;
        observation.landmark = m;
        const Eigen::Vector3d p_I = tracks.landmarks_G.back() - states[k].p_GI;
        EXPECT_TRUE(Project(camera,
                            camera.q_CI * p_I + camera.p_CI,
                            &observation.true_px,
                            nullptr));
        const double dx = random.Normal();
        const double dy = random.Normal();
        observation.measured_px =
            observation.true_px + pixel_noise_px * Eigen::Vector2d(dx, dy);
        tracks.observations.push_back(observation);
      }
    }
  }

  std::vector<std::optional<Eigen::Vector3d>> Triangulate(
      const SimulationOptions& options) const {
    Exposures exposures;
    exposures.AddCamera(states);
    return TriangulateLandmarks(rig.factory, exposures, tracks, 0.8, options);
  }
};

TEST(SlamLandmarksTest, PerfectPixelsAndAPerfectMapGiveTheTruth) {
  const Scene scene(0);
  const auto landmarks_G = scene.Triangulate(PerfectSlam());
  for (std::size_t m = 0; m < landmarks_G.size(); ++m) {
    ASSERT_TRUE(landmarks_G[m].has_value());
    EXPECT_LT((*landmarks_G[m] - scene.tracks.landmarks_G[m]).norm(), 1e-9);
  }
}

TEST(SlamLandmarksTest, WithParallaxTheNoiseOfThePixelsDecides) {
  const Scene scene(0.8);
  SimulationOptions options;
  options.slam_landmark_relative = 0.02;
  const auto landmarks_G = scene.Triangulate(options);
  double sum = 0;
  for (std::size_t m = 0; m < landmarks_G.size(); ++m) {
    ASSERT_TRUE(landmarks_G[m].has_value());
    sum += (*landmarks_G[m] - scene.tracks.landmarks_G[m]).squaredNorm();
  }
  // 0.8 px at 255 px over 3 m and a baseline of 1 m, eleven times.
  const double rms = std::sqrt(sum / static_cast<double>(landmarks_G.size()));
  EXPECT_GT(rms, 0.005);
  EXPECT_LT(rms, 0.05);
}

TEST(SlamLandmarksTest, AFewOutliersDoNotMoveALandmarkFar) {
  Scene scene(0.8);
  for (std::size_t i = 4; i < scene.tracks.observations.size(); i += 11) {
    scene.tracks.observations[i].measured_px = {600, 20};
  }
  const auto landmarks_G = scene.Triangulate({});
  for (std::size_t m = 0; m < landmarks_G.size(); ++m) {
    ASSERT_TRUE(landmarks_G[m].has_value());
    EXPECT_LT((*landmarks_G[m] - scene.tracks.landmarks_G[m]).norm(), 0.3);
  }
}

TEST(SlamLandmarksTest, ALandmarkThatMostObservationsContradictIsDropped) {
  Scene scene(0.8);
  Random random(2, 0);
  for (int i = 0; i < 11; ++i) {
    const double x = random.Uniform(0, 639);
    const double y = random.Uniform(0, 479);
    scene.tracks.observations[i].measured_px = {x, y};
  }
  const auto landmarks_G = scene.Triangulate({});
  EXPECT_FALSE(landmarks_G[0].has_value());
  EXPECT_TRUE(landmarks_G[1].has_value());
}

TEST(SlamLandmarksTest, TooFewObservationsGiveNoLandmark) {
  Scene scene(0.8);
  scene.tracks.observations.resize(11 + kMinSegmentObservations - 1);
  const auto landmarks_G = scene.Triangulate({});
  EXPECT_TRUE(landmarks_G[0].has_value());
  for (std::size_t m = 1; m < landmarks_G.size(); ++m) {
    EXPECT_FALSE(landmarks_G[m].has_value());
  }
}

}  // namespace
}  // namespace selfcal
