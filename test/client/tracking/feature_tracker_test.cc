// Tracks of rendered recordings against the truth of each recording. Limits are
// the figures of docs/recordings.md with some room: they describe the tracker.
#include "client/tracking/feature_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/model/camera_model.h"
#include "test/client/tracking/recording_kinds.h"
#include "test/client/tracking/track_errors.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr double kSeconds = 2.6;
constexpr int kImages = 50;

TrackedRecording TrackKind(const RecordingKind& kind,
                           std::uint64_t seed,
                           int images) {
  const RenderedRecording recording = Render(kind, kSeconds, seed);
  return TrackRecording(
      recording, kind.start(recording.rig().factory), kind.tracker, images);
}

// The tracks of a kind of recording, which several tests look at.
const TrackedRecording& Tracks(const std::string& kind) {
  static std::map<std::string, TrackedRecording> tracked;
  const auto [entry, is_new] = tracked.try_emplace(kind);
  if (is_new) entry->second = TrackKind(KindNamed(kind), 1, kImages);
  return entry->second;
}

client::TrackingCounts Total(const TrackedRecording& tracked) {
  client::TrackingCounts total;
  for (const client::TrackingCounts& counts : tracked.counts) {
    total.followed += counts.followed;
    total.lost += counts.lost;
    total.changed += counts.changed;
    total.rejected += counts.rejected;
    total.begun += counts.begun;
    total.stereo_found += counts.stereo_found;
    total.stereo_rejected += counts.stereo_rejected;
  }
  return total;
}

double LostShare(const TrackedRecording& tracked) {
  const client::TrackingCounts total = Total(tracked);
  return static_cast<double>(total.lost + total.changed + total.rejected) /
         total.followed;
}

TEST(FeatureTracker, ErrorsAreSmallAndDoNotGrowAlongATrack) {
  const TrackedRecording& tracked = Tracks("mono");
  const ErrorStatistics s = Summarise(tracked);
  EXPECT_GT(tracked.errors.size(), 190u * kImages);
  EXPECT_GT(s.mean_length, 10);
  EXPECT_LT(s.median_px, 0.08);
  EXPECT_LT(s.sigma_px, 0.25);
  EXPECT_LT(s.outlier_share, 0.015);
  ASSERT_GT(SigmaAtAge(tracked, 20), 0);
  EXPECT_LT(SigmaAtAge(tracked, 20), 0.3);
}

TEST(FeatureTracker, TracksDriftUnlessTheyAreAligned) {
  const ErrorStatistics s = Summarise(Tracks("mono-unaligned"));
  const ErrorStatistics aligned = Summarise(Tracks("mono"));
  EXPECT_GT(s.median_px, 5 * aligned.median_px);
  EXPECT_GT(s.outlier_share, aligned.outlier_share);
}

TEST(FeatureTracker, FollowsEveryCameraModel) {
  for (const DistortionModel model : DistortionModels()) {
    RecordingKind kind;
    kind.rig = LensRig(model);
    const TrackedRecording tracked = TrackKind(kind, 2, 12);
    const ErrorStatistics s = Summarise(tracked);
    EXPECT_GT(s.points, 1200) << DistortionName(model);
    EXPECT_LT(s.median_px, 0.1) << DistortionName(model);
    EXPECT_LT(s.outlier_share, 0.02) << DistortionName(model);
  }
}

TEST(FeatureTracker, SurvivesBlur) {
  const ErrorStatistics s = Summarise(Tracks("blur-20ms"));
  // 20 ms of up to 3 rad/s are 15 px.
  EXPECT_GT(s.mean_length, 5);
  EXPECT_LT(s.median_px, 0.5);
  EXPECT_LT(s.outlier_share, 0.02);
}

TEST(FeatureTracker, SurvivesChangesOfGain) {
  const TrackedRecording& steady = Tracks("mono");
  const TrackedRecording& changing = Tracks("gain");
  const ErrorStatistics a = Summarise(steady);
  const ErrorStatistics b = Summarise(changing);
  EXPECT_GT(b.mean_length, 0.85 * a.mean_length);
  EXPECT_LT(b.median_px, 1.3 * a.median_px);
  EXPECT_LT(b.outlier_share, 0.015);
}

TEST(FeatureTracker, RollingShutterCostsNothing) {
  const ErrorStatistics s = Summarise(Tracks("rolling-30ms"));
  EXPECT_GT(s.mean_length, 10);
  EXPECT_LT(s.median_px, 0.08);
  EXPECT_LT(s.outlier_share, 0.015);
}

TEST(FeatureTracker, ChecksRemoveOutliers) {
  const ErrorStatistics checked = Summarise(Tracks("mono"));
  const ErrorStatistics unchecked = Summarise(Tracks("unchecked"));
  EXPECT_GT(unchecked.outlier_share, 3 * checked.outlier_share);
}

TEST(FeatureTracker, PointsOnMovingBoxesAreRejected) {
  // Tracks that move with a box for longer than a few images.
  const auto long_moving = [](const TrackedRecording& tracked) {
    int points = 0;
    for (const TrackError& error : tracked.errors) {
      if (error.moving && error.age >= 5) ++points;
    }
    return points;
  };
  const int checked = long_moving(Tracks("moving"));
  const int unchecked = long_moving(Tracks("moving-unchecked"));
  ASSERT_GT(unchecked, 200);
  EXPECT_LT(checked, 0.7 * unchecked);
}

TEST(FeatureTracker, ACalibrationThatIsWrongLosesNoTracks) {
  const TrackedRecording& right = Tracks("mono");
  const TrackedRecording& wrong = Tracks("wrong-start");
  EXPECT_LT(LostShare(wrong), LostShare(right) + 0.02);
  EXPECT_LT(Summarise(wrong).median_px, 0.1);
}

// The tracker takes the rotation of the perspective from the gyroscope, but not
// what adds up of its bias: that of a poor part would bend patches by tenths of
// a radian within a long track.
TEST(FeatureTracker, ABiasOfTheGyroscopeDoesNotMovePoints) {
  RecordingKind kind = KindNamed("calm");
  std::map<std::pair<std::uint64_t, int>, Eigen::Vector2d> right;
  for (const TrackError& error : Tracks("calm").errors) {
    right[{error.point.landmark, error.point.image}] = error.point.z_px;
  }
  kind.tracker.b_g = {0.08, -0.08, 0.08};
  double squares = 0;
  int points = 0;
  // Landmarks of the first image have the same numbers.
  for (const TrackError& error : TrackKind(kind, 1, kImages).errors) {
    const auto same = right.find({error.point.landmark, error.point.image});
    if (error.point.landmark > 150 || error.age < 20 || same == right.end()) {
      continue;
    }
    const double square = (error.point.z_px - same->second).squaredNorm();
    if (square > 0.25) continue;  // one of both is an outlier
    squares += square;
    ++points;
  }
  ASSERT_GT(points, 500);
  std::printf(
      "%d points, %.4f px apart\n", points, std::sqrt(squares / points));
  // Points are aligned to 0.003 px; the whole bias moves them by 0.016 px.
  EXPECT_LT(std::sqrt(squares / points), 0.01);
}

TEST(FeatureTracker, StereoMatchesAreTheSamePoint) {
  for (const std::string name : {"stereo", "stereo-wrong-start"}) {
    const TrackedRecording tracked = TrackKind(KindNamed(name), 1, 25);
    // The first point of a landmark in the camera in which it did not begin.
    std::set<std::pair<int, std::uint64_t>> seen;
    int matches = 0;
    int outliers = 0;
    std::vector<double> distances;
    for (const TrackError& error : tracked.errors) {
      const bool is_new =
          seen.emplace(error.point.camera, error.point.landmark).second;
      if (!is_new || error.first) continue;
      ++matches;
      const double distance = error.error_px.norm();
      if (!error.in_view || distance > kOutlier_px) ++outliers;
      distances.push_back(distance);
    }
    ASSERT_GT(matches, 200) << name;
    EXPECT_LT(outliers, 0.02 * matches) << name;
    std::sort(distances.begin(), distances.end());
    EXPECT_LT(distances[distances.size() / 2], 0.1) << name;
  }
}

TEST(FeatureTracker, IsTheSameToTheBitForTheSameImages) {
  const TrackedRecording a = TrackKind(KindNamed("stereo"), 3, 8);
  const TrackedRecording b = TrackKind(KindNamed("stereo"), 3, 8);
  ASSERT_EQ(a.errors.size(), b.errors.size());
  for (std::size_t i = 0; i < a.errors.size(); ++i) {
    EXPECT_EQ(a.errors[i].point.landmark, b.errors[i].point.landmark);
    EXPECT_EQ(a.errors[i].point.z_px, b.errors[i].point.z_px);
  }
}

class SingleImages : public testing::Test {
 protected:
  SingleImages()
      : recording_(Render(KindNamed("calm"), 1, 1)),
        tracker_(recording_.rig().factory, {}) {
    for (const ImuSample& sample : recording_.imu().measured) {
      tracker_.AddImu(sample);
    }
  }
  std::vector<client::TrackPoint> Track(int image) {
    const GreyImage rendered = recording_.Image(0, image);
    const cv::Mat mat(rendered.height_px,
                      rendered.width_px,
                      CV_8UC1,
                      const_cast<std::uint8_t*>(rendered.pixels.data()));
    return tracker_.Track(recording_.stamp_ns(image), {mat});
  }
  std::size_t Common(const std::vector<client::TrackPoint>& a,
                     const std::vector<client::TrackPoint>& b) {
    std::set<std::uint64_t> landmarks;
    for (const client::TrackPoint& point : a) landmarks.insert(point.landmark);
    return static_cast<std::size_t>(
        std::count_if(b.begin(), b.end(), [&](const client::TrackPoint& p) {
          return landmarks.contains(p.landmark);
        }));
  }

  RenderedRecording recording_;
  client::FeatureTracker tracker_;
};

TEST_F(SingleImages, TracksContinueAfterADroppedImage) {
  const auto first = Track(0);
  ASSERT_GT(first.size(), 150u);
  EXPECT_TRUE(tracker_.Track(recording_.stamp_ns(1), {cv::Mat()}).empty());
  const auto later = Track(2);
  EXPECT_GT(Common(first, later), 0.8 * first.size());
  EXPECT_EQ(later.front().image, 2);
}

TEST_F(SingleImages, ImagesOfAnotherSizeOrTypeAreTreatedAsDropped) {
  const auto first = Track(0);
  const cv::Mat small(240, 320, CV_8UC1, cv::Scalar(90));
  const cv::Mat deep(480, 640, CV_16UC1, cv::Scalar(90));
  EXPECT_TRUE(tracker_.Track(recording_.stamp_ns(1), {small}).empty());
  EXPECT_TRUE(tracker_.Track(recording_.stamp_ns(2), {deep}).empty());
  EXPECT_TRUE(tracker_.Track(recording_.stamp_ns(3), {}).empty());
  EXPECT_GT(Common(first, Track(4)), 0.7 * first.size());
}

TEST_F(SingleImages, ABlackImageEndsAllTracksAndTheNextBeginsNewOnes) {
  const auto first = Track(0);
  const cv::Mat black(480, 640, CV_8UC1, cv::Scalar(0));
  EXPECT_TRUE(tracker_.Track(recording_.stamp_ns(1), {black}).empty());
  const auto later = Track(2);
  EXPECT_GT(later.size(), 150u);
  EXPECT_EQ(Common(first, later), 0u);
}

TEST_F(SingleImages, PointsAreOneForEachLandmarkAndInsideTheImage) {
  for (int k = 0; k < 10; ++k) {
    std::set<std::uint64_t> landmarks;
    for (const client::TrackPoint& point : Track(k)) {
      EXPECT_TRUE(landmarks.insert(point.landmark).second);
      EXPECT_GE(point.z_px.minCoeff(), 0);
      EXPECT_LT(point.z_px.x(), 640);
      EXPECT_LT(point.z_px.y(), 480);
      EXPECT_EQ(point.camera, 0);
      EXPECT_EQ(point.image, k);
    }
    EXPECT_LE(landmarks.size(), 200u);
  }
}

}  // namespace
}  // namespace selfcal
