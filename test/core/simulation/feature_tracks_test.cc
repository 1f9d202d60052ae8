#include "core/simulation/feature_tracks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "core/simulation/imu_readings.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

std::vector<KeyframeState> Keyframes(const Trajectory& trajectory,
                                     double late_s = 0) {
  std::vector<KeyframeState> keyframes;
  for (double t = 0; t + 0.1 < trajectory.duration_s(); t += 0.1) {
    const BodyMotion motion = trajectory.At(t + late_s);
    KeyframeState state;
    state.q_GI = motion.q_GI;
    state.p_GI = motion.p_GI;
    keyframes.push_back(state);
  }
  return keyframes;
}

// Lengths of the runs of consecutive keyframes in which a camera observes a
// landmark, and the number of runs of each landmark in camera 0.
struct Lengths {
  std::vector<int> lengths;
  std::map<int, int> stretches;
};

Lengths TrackLengths(const FeatureTracks& tracks) {
  Lengths result;
  std::map<std::pair<int, int>, std::pair<int, int>> open;  // last, length
  for (const FeatureObservation& z : tracks.observations) {
    const std::pair<int, int> key(z.camera, z.landmark);
    const auto it = open.find(key);
    if (it != open.end() && it->second.first == z.keyframe - 1) {
      it->second = {z.keyframe, it->second.second + 1};
      continue;
    }
    if (it != open.end()) result.lengths.push_back(it->second.second);
    open[key] = {z.keyframe, 1};
    if (z.camera == 0) ++result.stretches[z.landmark];
  }
  for (const auto& [key, track] : open) {
    result.lengths.push_back(track.second);
  }
  return result;
}

double Mean(const std::vector<int>& values) {
  double sum = 0;
  for (const int value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// Tracks of cameras without a time offset.
FeatureTracks Tracks(const Rig& rig,
                     double pixel_sigma_px,
                     const std::vector<KeyframeState>& keyframes,
                     const SimulationOptions& options) {
  Exposures exposures;
  for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
    exposures.AddCamera(keyframes);
  }
  return SimulateTracks(rig.factory,
                        pixel_sigma_px,
                        static_cast<int>(keyframes.size()),
                        exposures,
                        options);
}

TEST(FeatureTracksTest, WhereNothingLeavesTheImageLengthsAreGeometric) {
  Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.mean_track_length = 8;
  options.noise = false;
  const Lengths tracks =
      TrackLengths(Tracks(rig, 0, Keyframes(*MakeRest(200)), options));
  const auto n = static_cast<double>(tracks.lengths.size());
  EXPECT_NEAR(Mean(tracks.lengths), 8, 5 * 8 / std::sqrt(n));
  double ones = 0;
  for (const int length : tracks.lengths) ones += length == 1;
  EXPECT_NEAR(ones / n, 1.0 / 8, 5 * std::sqrt(0.11 / n));
}

TEST(FeatureTracksTest, NoTrackIsLongerThanTheMaximum) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.mean_track_length = 8;
  options.max_track_length = 6;
  options.revisit_fraction = 0;
  const Lengths tracks =
      TrackLengths(Tracks(rig, 0, Keyframes(*MakeRest(60)), options));
  EXPECT_EQ(*std::max_element(tracks.lengths.begin(), tracks.lengths.end()), 6);
}

TEST(FeatureTracksTest, MotionEndsTracksEarlier) {
  const Rig rig = HandheldRig("a");
  const Lengths tracks =
      TrackLengths(Tracks(rig, 0.8, Keyframes(*MakeHandheld(60, 1, 1)), {}));
  EXPECT_LT(Mean(tracks.lengths), 9.5);
  EXPECT_GT(Mean(tracks.lengths), 5);
}

TEST(FeatureTracksTest, EachCameraSeesTheWantedNumberInEveryKeyframe) {
  const Rig rig = StereoRig();
  const auto keyframes = Keyframes(*MakeHandheld(30, 1, 2));
  SimulationOptions options;
  options.landmarks_in_view = 80;
  const FeatureTracks tracks = Tracks(rig, 0.8, keyframes, options);
  std::map<std::pair<int, int>, int> seen;
  for (const FeatureObservation& z : tracks.observations) {
    ++seen[{z.keyframe, z.camera}];
  }
  ASSERT_EQ(seen.size(), 2 * keyframes.size());
  for (const auto& [key, count] : seen) EXPECT_EQ(count, 80);
}

TEST(FeatureTracksTest, AFishEyeSeesWhatIsBehindItsImagePlane) {
  const auto keyframes = Keyframes(*MakeHandheld(20, 1, 3));
  for (const DistortionModel model : DistortionModels()) {
    const Rig rig = LensRig(model);
    const CameraCalibration& camera = rig.factory.cameras[0];
    const FeatureTracks tracks = Tracks(rig, 0, keyframes, {});
    int behind = 0;
    for (const FeatureObservation& z : tracks.observations) {
      const KeyframeState& x = keyframes[z.keyframe];
      const Eigen::Vector3d p_I =
          x.q_GI.conjugate() * (tracks.landmarks_G[z.landmark] - x.p_GI);
      const Eigen::Vector3d p_C = camera.q_CI * p_I + camera.p_CI;
      behind += p_C.z() < 0;
      // The landmark is on the ray of its pixel, not on the opposite one.
      Eigen::Vector3d bearing_C;
      ASSERT_TRUE(Unproject(camera, z.measured_px, &bearing_C));
      EXPECT_LT((p_C.normalized() - bearing_C).norm(), 1e-7);
    }
    const bool pinhole = DistortionName(model) == "fov" ||
                         DistortionName(model).starts_with("radial-tangential");
    const double share =
        behind / static_cast<double>(tracks.observations.size());
    if (pinhole) {
      EXPECT_EQ(behind, 0);
    } else {
      EXPECT_GT(share, 0.1) << DistortionName(model);
    }
  }
}

TEST(FeatureTracksTest, TheCamerasOfARigSeeTheSameLandmarks) {
  const FeatureTracks tracks =
      Tracks(StereoRig(), 0.8, Keyframes(*MakeHandheld(20, 1, 2)), {});
  std::map<int, std::pair<bool, bool>> cameras;
  for (const FeatureObservation& z : tracks.observations) {
    (z.camera == 0 ? cameras[z.landmark].first : cameras[z.landmark].second) =
        true;
  }
  double both = 0;
  for (const auto& [landmark, seen] : cameras) {
    both += seen.first && seen.second;
  }
  EXPECT_GT(both / static_cast<double>(cameras.size()), 0.3);
}

TEST(FeatureTracksTest, AFractionOfTheLandmarksIsFoundAgainAfterAWhile) {
  const Rig rig = HandheldRig("a");
  const auto keyframes = Keyframes(*MakeHandheld(60, 1, 3));
  SimulationOptions options;
  const auto again = [&] {
    double count = 0;
    double all = 0;
    for (const auto& [landmark, stretches] :
         TrackLengths(Tracks(rig, 0.8, keyframes, options)).stretches) {
      count += stretches > 1;
      ++all;
    }
    return count / all;
  };
  EXPECT_GT(again(), 0.02);
  EXPECT_LT(again(), 0.15);
  options.revisit_fraction = 0;
  EXPECT_EQ(again(), 0);
}

TEST(FeatureTracksTest, EveryPixelLiesInsideTheImageOutliersToo) {
  const Rig rig = StereoRig();
  SimulationOptions options;
  options.outlier_fraction = 0.1;
  const FeatureTracks tracks =
      Tracks(rig, 3, Keyframes(*MakeHandheld(20, 1, 4)), options);
  ASSERT_FALSE(tracks.observations.empty());
  for (const FeatureObservation& z : tracks.observations) {
    const CameraCalibration& camera = rig.factory.cameras[z.camera];
    for (const Eigen::Vector2d& z_px : {z.true_px, z.measured_px}) {
      ASSERT_GE(z_px.minCoeff(), 0);
      ASSERT_LE(z_px.x(), camera.width_px - 1);
      ASSERT_LE(z_px.y(), camera.height_px - 1);
    }
  }
}

TEST(FeatureTracksTest, TheWantedFractionOfObservationsIsReplaced) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.noise = false;
  options.outlier_fraction = 0.07;
  const FeatureTracks tracks =
      Tracks(rig, 0.8, Keyframes(*MakeHandheld(60, 1, 5)), options);
  double replaced = 0;
  for (const FeatureObservation& z : tracks.observations) {
    replaced += z.true_px != z.measured_px;
  }
  const auto n = static_cast<double>(tracks.observations.size());
  EXPECT_NEAR(replaced / n, 0.07, 5 * std::sqrt(0.07 / n));
}

TEST(FeatureTracksTest, TheWantedFractionOfLandmarksMoves) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.noise = false;
  options.revisit_fraction = 0;
  options.moving_fraction = 0.2;
  const FeatureTracks tracks =
      Tracks(rig, 0.8, Keyframes(*MakeHandheld(60, 1, 5)), options);
  // Landmarks that were seen for a second, by whether they moved.
  std::map<int, double> largest_px, seen;
  for (const FeatureObservation& z : tracks.observations) {
    double& error_px = largest_px[z.landmark];
    error_px = std::max(error_px, (z.true_px - z.measured_px).norm());
    ++seen[z.landmark];
  }
  double moved = 0, n = 0;
  for (const auto& [landmark, error_px] : largest_px) {
    if (seen[landmark] < 10) continue;
    ++n;
    moved += error_px > 1;
  }
  ASSERT_GT(n, 1000);
  EXPECT_NEAR(moved / n, 0.2, 5 * std::sqrt(0.2 * 0.8 / n));
}

// Tracks of a device at rest end at random only: what is measured of errors is
// that of all tracks.
TEST(FeatureTracksTest, ErrorsOfATrackerHaveTheStatedTailsAndCorrelation) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.revisit_fraction = 0;
  options.mean_track_length = 20;
  UseTrackerErrors(&options);
  options.outlier_fraction = 0;
  const FeatureTracks tracks = Tracks(
      rig, kTrackerSigma_px, Keyframes(*MakeHandheld(120, 0.3, 6)), options);
  // Distances of the second observation of each landmark, and the cosine
  // between the errors of observations that are this many keyframes apart.
  std::map<int, std::vector<Eigen::Vector2d>> errors;
  for (const FeatureObservation& z : tracks.observations) {
    errors[z.landmark].push_back(z.measured_px - z.true_px);
  }
  std::vector<double> distances;
  std::map<std::size_t, std::pair<double, double>> cosines;  // sum, number
  for (const auto& [landmark, of_track] : errors) {
    EXPECT_EQ(of_track[0].norm(), 0);
    if (of_track.size() > 1) distances.push_back(of_track[1].norm());
    for (const std::size_t apart : {1, 15}) {
      if (of_track.size() < apart + 2) continue;
      const Eigen::Vector2d a = of_track[1].normalized();
      cosines[apart].first += a.dot(of_track[1 + apart].normalized());
      ++cosines[apart].second;
    }
  }
  std::sort(distances.begin(), distances.end());
  const auto n = static_cast<double>(distances.size());
  ASSERT_GT(n, 5'000);
  // Student's distribution in two dimensions: P(d > x) = (1 + (x / s)^2 / nu)^
  // (-nu / 2).
  for (const double part : {0.1, 0.5, 0.9, 0.95}) {
    const double x_px =
        kTrackerSigma_px * std::sqrt(1.5 * (std::pow(1 - part, -2 / 1.5) - 1));
    const auto below =
        std::lower_bound(distances.begin(), distances.end(), x_px) -
        distances.begin();
    // A thousandth of the tail is cut off.
    EXPECT_NEAR(static_cast<double>(below) / n,
                part,
                0.003 + 4 * std::sqrt(part * (1 - part) / n));
  }
  // The mean cosine of two directions of normal vectors with a correlation c
  // is pi / 4 c (1 + c^2 / 8 + 3 c^4 / 64 + ...).
  const auto cosine = [](double c) {
    double sum = 0, term = std::numbers::pi / 4 * c;
    for (int k = 0; k < 200; ++k) {
      sum += term;
      term *= c * c * (k + 0.5) * (k + 0.5) / ((k + 1.0) * (k + 2.0));
    }
    return sum;
  };
  for (const auto& [apart, sum] : cosines) {
    const double drift =
        std::pow(options.pixel_correlation, static_cast<double>(apart));
    EXPECT_NEAR(
        sum.first / sum.second,
        cosine(options.pixel_shared + (1 - options.pixel_shared) * drift),
        4 / std::sqrt(2 * sum.second))
        << apart;
  }
}

// Each point is where it projects when the row of its image is exposed: the
// poses there are those of the trajectory.
TEST(FeatureTracksTest, RowsOfARollingShutterAreExposedOneAfterTheOther) {
  constexpr double kLineDelay_s = 33e-3 / 480;
  constexpr double kRate_Hz = 10;
  const Rig rig = HandheldRig("a");
  const CameraCalibration& camera = rig.factory.cameras[0];
  const auto motion = MakeHandheld(61, 1, 5);
  const auto row_state = [&](int k, double row_px) {
    const BodyMotion at = motion->At(k / kRate_Hz + kLineDelay_s * row_px);
    return KeyframeState{.q_GI = at.q_GI, .p_GI = at.p_GI};
  };
  Exposures rows;
  rows.AddCamera(row_state);
  SimulationOptions options;
  options.noise = false;
  const FeatureTracks tracks =
      SimulateTracks(rig.factory, 0, 600, rows, options);
  ASSERT_GT(tracks.observations.size(), 10'000u);
  double moved_px = 0;
  for (const FeatureObservation& z : tracks.observations) {
    const auto project = [&](double row_px) {
      const KeyframeState x = row_state(z.keyframe, row_px);
      const Eigen::Vector3d p_I =
          x.q_GI.conjugate() * (tracks.landmarks_G[z.landmark] - x.p_GI);
      Eigen::Vector2d z_px(0, 0);
      Project(camera, camera.q_CI * p_I + camera.p_CI, &z_px, nullptr);
      return z_px;
    };
    EXPECT_LT((project(z.true_px.y()) - z.true_px).norm(), 1e-6);
    moved_px = std::max(moved_px, (project(0) - z.true_px).norm());
  }
  EXPECT_GT(moved_px, 10);
}

// The errors lie along the blur and have the stated size relative to it,
// according to projections of the landmarks at both ends of the exposure.
TEST(FeatureTracksTest, BlurMakesErrorsAlongTheWayOfALandmarkInTheImage) {
  constexpr double kExposure_s = 0.01;
  const Rig rig = HandheldRig("a");
  const CameraCalibration& camera = rig.factory.cameras[0];
  const auto motion = MakeHandheld(60, 1, 5);
  const std::vector<KeyframeState> keyframes = Keyframes(*motion);
  Exposures open, closed;
  open.AddCamera(keyframes);
  closed.AddCamera(Keyframes(*motion, kExposure_s));
  SimulationOptions options;
  options.exposure_s = kExposure_s;
  options.blur_error = 0.2;
  const FeatureTracks tracks =
      SimulateTracks(rig.factory,
                     0,
                     static_cast<int>(keyframes.size()),
                     open,
                     options,
                     closed);
  double square = 0, n = 0;
  for (const FeatureObservation& z : tracks.observations) {
    const KeyframeState x = closed.At(0, z.keyframe, z.true_px.y());
    const Eigen::Vector3d p_I =
        x.q_GI.conjugate() * (tracks.landmarks_G[z.landmark] - x.p_GI);
    Eigen::Vector2d end_px;
    if (!Project(camera, camera.q_CI * p_I + camera.p_CI, &end_px, nullptr)) {
      continue;
    }
    const Eigen::Vector2d blur_px = end_px - z.true_px;
    const Eigen::Vector2d error_px = z.measured_px - z.true_px;
    const double part = error_px.dot(blur_px) / blur_px.squaredNorm();
    if (part == 0) continue;  // it left the image meanwhile
    ASSERT_LT((error_px - part * blur_px).norm(), 1e-6 * blur_px.norm());
    square += part * part;
    ++n;
  }
  ASSERT_GT(n, 10'000);
  EXPECT_NEAR(std::sqrt(square / n), 0.2, 5 * 0.2 / std::sqrt(2 * n));
}

TEST(FeatureTracksTest, WithoutExposureTimeNothingIsBlurred) {
  const Rig rig = HandheldRig("a");
  const auto keyframes = Keyframes(*MakeHandheld(20, 1, 5));
  SimulationOptions options;
  const FeatureTracks sharp = Tracks(rig, 0.8, keyframes, options);
  options.blur_error = 1;
  const FeatureTracks same = Tracks(rig, 0.8, keyframes, options);
  ASSERT_EQ(sharp.observations.size(), same.observations.size());
  for (std::size_t i = 0; i < sharp.observations.size(); ++i) {
    ASSERT_EQ(sharp.observations[i].measured_px,
              same.observations[i].measured_px);
  }
}

TEST(FeatureTracksTest, NewLandmarksLieBetweenTheDepthsOfTheOptions) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.min_depth_m = 1;
  options.max_depth_m = 4;
  const auto keyframes = Keyframes(*MakeRest(1));
  const FeatureTracks tracks = Tracks(rig, 0, keyframes, options);
  const CameraCalibration& camera = rig.factory.cameras[0];
  const Eigen::Vector3d p_GC =
      keyframes[0].p_GI -
      keyframes[0].q_GI * (camera.q_CI.conjugate() * camera.p_CI);
  double near = 0;
  for (const Eigen::Vector3d& p_G : tracks.landmarks_G) {
    const double depth_m = (p_G - p_GC).norm();
    EXPECT_GE(depth_m, 1 - 1e-9);
    EXPECT_LE(depth_m, 4 + 1e-9);
    near += depth_m < 2;
  }
  // Uniform in the logarithm: half of them below the geometric mean.
  const auto n = static_cast<double>(tracks.landmarks_G.size());
  EXPECT_NEAR(near / n, 0.5, 2.5 / std::sqrt(n));
}

}  // namespace
}  // namespace selfcal
