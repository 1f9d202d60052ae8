#include "client/selfcal/track_positions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/model/camera.h"
#include "core/simulation/simulate.h"

namespace selfcal::client {
namespace {

constexpr double kSigma_px = 0.8;
constexpr double kGravity_mps2 = 9.81;

// A camera that looks along z and moves sideways by 2 cm a keyframe.
class TrackPositions : public ::testing::Test {
 protected:
  TrackPositions() {
    theta_.cameras[0].q_CI.setIdentity();
    for (int k = 0; k < 20; ++k) {
      KeyframeState x;
      x.t_ns = k * 100'000'000;
      x.p_GI = {0.02 * k, 0, 0};
      keyframes_.push_back(x);
    }
  }

  Track Observe(const Eigen::Vector3d& p_G) {
    Track track;
    std::normal_distribution<double> noise(0, kSigma_px);
    for (int k = 0; k < static_cast<int>(keyframes_.size()); ++k) {
      Eigen::Vector2d z_px;
      const CameraCalibration& camera = theta_.cameras[0];
      const Eigen::Vector3d p_I = p_G - keyframes_[k].p_GI;
      if (Project(camera, camera.q_CI * p_I + camera.p_CI, &z_px, nullptr)) {
        z_px += Eigen::Vector2d(noise(random_), noise(random_));
        track.observations.push_back({k, 0, z_px});
      }
    }
    return track;
  }

  std::optional<Eigen::Vector3d> Position(const Track& track) const {
    MotionSegment segment;
    segment.keyframes = keyframes_;
    return TriangulateTracks(theta_,
                             segment,
                             std::vector<Track>{track},
                             kSigma_px,
                             kGravity_mps2)
        .front();
  }

  std::mt19937 random_{1};
  Calibration theta_ = HandheldRig("a").factory;
  std::vector<KeyframeState> keyframes_;
};

// A point in front of the camera at the middle of the motion.
Eigen::Vector3d InView(const Calibration& theta, double depth_m) {
  const CameraCalibration& camera = theta.cameras[0];
  return camera.q_CI.conjugate() *
             (Eigen::Vector3d(0.1, -0.2, 1) * depth_m - camera.p_CI) +
         Eigen::Vector3d(0.2, 0, 0);
}

TEST_F(TrackPositions, FindAPointWithParallax) {
  for (const double depth_m : {0.7, 1.5, 3.0}) {
    const Eigen::Vector3d p_G = InView(theta_, depth_m);
    const auto found = Position(Observe(p_G));
    ASSERT_TRUE(found.has_value()) << depth_m;
    // sigma = depth^2 sigma_px / (f * root of the sum of squared baselines), at
    // 20 positions that are 2 cm apart: 0.52 m.
    const double sigma_m = depth_m * depth_m * kSigma_px / (255 * 0.52);
    EXPECT_LT((*found - p_G).norm(), 4 * sigma_m);
  }
}

TEST_F(TrackPositions, DoNotDependOnAFewOutliers) {
  const Eigen::Vector3d p_G = InView(theta_, 1.5);
  Track track = Observe(p_G);
  ASSERT_GE(track.observations.size(), 15u);
  for (std::size_t i = 0; i < track.observations.size(); i += 5) {
    track.observations[i].z_px += Eigen::Vector2d(40, -25);
  }
  const auto found = Position(track);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - p_G).norm(), 0.06);
}

TEST_F(TrackPositions, AreNoneWithoutParallax) {
  EXPECT_FALSE(Position(Observe(InView(theta_, 200))).has_value());
  Track two = Observe(InView(theta_, 8));
  two.observations.resize(2);
  EXPECT_FALSE(Position(two).has_value());
  two.observations.resize(1);
  EXPECT_FALSE(Position(two).has_value());
  EXPECT_FALSE(Position({}).has_value());
}

TEST_F(TrackPositions, AreNoneIfMostObservationsDisagree) {
  Track track = Observe(InView(theta_, 1.5));
  std::uniform_real_distribution<double> pixel(0, 480);
  for (TrackObservation& seen : track.observations) {
    seen.z_px = {pixel(random_), pixel(random_)};
  }
  EXPECT_FALSE(Position(track).has_value());
}

TEST_F(TrackPositions, AreThoseOfTheExposures) {
  SimulationOptions options;
  options.noise = false;
  const Rig rig = HandheldRig("a");
  Calibration theta = rig.factory;
  theta.cameras[0].time_offset_s = 0.012;
  const MotionSegment truth =
      Simulate(rig, theta, theta, *MakeHandheld(6, 1, 5), "s", options)
          .truth.front();
  std::vector<Track> tracks(truth.landmarks.size());
  for (const Observation& o : truth.observations) {
    tracks[o.landmark].observations.push_back({o.keyframe, o.camera, o.z_px});
  }
  const auto positions =
      TriangulateTracks(theta, truth, tracks, kSigma_px, kGravity_mps2);
  int found = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!positions[i]) continue;
    ++found;
    EXPECT_LT((*positions[i] - truth.landmarks[i].p_G).norm(), 0.02);
  }
  EXPECT_GT(found, static_cast<int>(tracks.size() / 2));
}

}  // namespace
}  // namespace selfcal::client
