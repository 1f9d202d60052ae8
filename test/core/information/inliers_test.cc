#include "core/information/inliers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "core/factor/reprojection.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

InlierSelection Select(const Rig& rig, const MotionSegment& segment) {
  return SelectInliers(rig, rig.factory, segment, {});
}

TEST(SelectInliers, KeepsEverythingOfAPerfectSegmentAndMovesNothing) {
  const Rig rig = TwoCameraRig();
  const MotionSegment segment = MovingSegment(rig, 1);
  const InlierSelection selection = Select(rig, segment);
  EXPECT_EQ(selection.inliers.size(), segment.observations.size());
  for (std::size_t m = 0; m < segment.landmarks.size(); ++m) {
    EXPECT_LT((selection.landmarks[m] - segment.landmarks[m].p_G).norm(), 1e-6);
  }
  const ResidualStatistics& statistics = selection.statistics;
  EXPECT_EQ(statistics.inliers, statistics.observations);
  EXPECT_EQ(statistics.outliers, 0);
  EXPECT_EQ(statistics.landmarks_used, statistics.landmarks);
  EXPECT_LT(statistics.reprojection_rms_px, 1e-6);
  EXPECT_FALSE(statistics.many_outliers);
}

// The calibration is a factory calibration, states and landmarks are a SLAM
// system's.
TEST(SelectInliers, FindsGrossOutliersUnderAWrongCalibration) {
  const Rig rig = HandheldRig("handheld");
  int gross = 0, missed = 0, good = 0, lost = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SimulationOptions options;
    options.seed = seed;
    options.outlier_fraction = 0.05;
    const Calibration theta = PerturbCalibration(rig.factory, {}, seed);
    const SegmentPair pair =
        OneSegment(rig, theta, *MakeHandheld(4.1, 1, seed), options);
    const InlierSelection selection = SelectInliers(rig, theta, pair.slam, {});
    const std::set<int> inliers(selection.inliers.begin(),
                                selection.inliers.end());
    for (int i = 0; i < static_cast<int>(pair.slam.observations.size()); ++i) {
      const double error_px =
          (pair.slam.observations[i].z_px - pair.truth.observations[i].z_px)
              .norm();
      if (error_px > 20) {
        ++gross;
        missed += inliers.contains(i);
      } else if (error_px < 4) {
        ++good;
        lost += !inliers.contains(i);
      }
    }
    EXPECT_FALSE(selection.statistics.many_outliers);
  }
  RecordProperty("missed", missed);
  ASSERT_GT(gross, 500);
  EXPECT_LT(missed, 0.02 * gross);
  EXPECT_LT(lost, 0.03 * good);
}

TEST(SelectInliers, CountsAddUpAndManyOutliersAreFlagged) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 3);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> x(0, 639), y(0, 479);
  for (std::size_t i = 0; i < segment.observations.size(); i += 3) {
    segment.observations[i].z_px = {x(random), y(random)};
  }
  const InlierSelection selection = Select(rig, segment);
  const ResidualStatistics& statistics = selection.statistics;
  EXPECT_TRUE(statistics.many_outliers);
  EXPECT_EQ(statistics.observations,
            static_cast<int>(segment.observations.size()));
  EXPECT_EQ(statistics.inliers, static_cast<int>(selection.inliers.size()));
  EXPECT_LE(
      statistics.inliers + statistics.outliers + statistics.not_projectable,
      statistics.observations);
  EXPECT_GT(statistics.outliers, 0.25 * statistics.observations);
}

TEST(SelectInliers, InliersAreSortedAndOfAtLeastTwoALandmark) {
  const Rig rig = TwoCameraRig();
  MotionSegment segment = MovingSegment(rig, 4);
  // Leaves some landmarks with one observation.
  std::erase_if(segment.observations, [](const Observation& o) {
    return o.landmark % 5 == 0 && (o.keyframe + o.camera) % 7 != 0;
  });
  const InlierSelection selection = Select(rig, segment);
  std::map<int, int> count;
  std::tuple<int, int, int> last{-1, -1, -1};
  for (const int i : selection.inliers) {
    const Observation& o = segment.observations[i];
    const std::tuple<int, int, int> key{o.landmark, o.keyframe, o.camera};
    EXPECT_LT(last, key);
    last = key;
    ++count[o.landmark];
  }
  for (const auto& [landmark, n] : count) EXPECT_GE(n, 2);
  EXPECT_EQ(selection.statistics.landmarks_used,
            static_cast<int>(count.size()));
}

TEST(SelectInliers, APointBehindTheCameraIsCountedAndExcluded) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 5);
  const CameraCalibration& camera = rig.factory.cameras[0];
  const Observation first = segment.observations[0];
  // Mirrored at the camera's centre.
  const KeyframeState& x = segment.keyframes[first.keyframe];
  const Eigen::Vector3d centre_G =
      x.p_GI - x.q_GI * (camera.q_CI.conjugate() * camera.p_CI);
  Landmark& landmark = segment.landmarks[first.landmark];
  landmark.p_G = 2 * centre_G - landmark.p_G;
  const InlierSelection selection = Select(rig, segment);
  EXPECT_GT(selection.statistics.not_projectable, 0);
  for (const int i : selection.inliers) {
    EXPECT_NE(segment.observations[i].landmark, first.landmark);
  }
}

TEST(SelectInliers, NothingToSelectFromIsNoError) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 6);
  segment.observations.clear();
  const InlierSelection selection = Select(rig, segment);
  EXPECT_TRUE(selection.inliers.empty());
  EXPECT_EQ(selection.statistics.reprojection_median_px, 0);
  EXPECT_EQ(selection.statistics.reprojection_rms_px, 0);
  EXPECT_FALSE(selection.statistics.many_outliers);
}

// Root mean square distance [px] of the projections of two points in a track,
// excluding its observation `except`.
double AppearanceError(const Rig& rig,
                       const MotionSegment& segment,
                       const std::vector<int>& track,
                       int except,
                       const Eigen::Vector3d& p_G) {
  double sum = 0;
  for (const int index : track) {
    const Observation& o = segment.observations[index];
    const KeyframeState& x = segment.keyframes[o.keyframe];
    Eigen::Vector2d r;
    if (index == except) continue;
    EXPECT_TRUE(Reproject(x.q_GI,
                          x.p_GI,
                          rig.factory.cameras[o.camera],
                          p_G.homogeneous(),
                          o.z_px,
                          &r,
                          nullptr));
    sum += r.squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(track.size() - 1));
}

TEST(SelectInliers, BringsNoisyLandmarksBackAlthoughOneObservationIsWrong) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment truth = MovingSegment(rig, 7);
  std::vector<std::vector<int>> tracks(truth.landmarks.size());
  for (int i = 0; i < static_cast<int>(truth.observations.size()); ++i) {
    tracks[truth.observations[i].landmark].push_back(i);
  }
  std::erase_if(tracks, [](const auto& track) { return track.size() < 8; });
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 0.05);
  MotionSegment segment = truth;
  for (const std::vector<int>& track : tracks) {
    segment.observations[track[2]].z_px += Eigen::Vector2d(60, -45);
    const Observation& first = segment.observations[track[0]];
    Eigen::Vector3d& p_G = segment.landmarks[first.landmark].p_G;
    const double distance_m =
        (p_G - truth.keyframes[first.keyframe].p_GI).norm();
    p_G += distance_m *
           Eigen::Vector3d(normal(random), normal(random), normal(random));
  }
  const InlierSelection selection = Select(rig, segment);
  int good = 0;
  for (const std::vector<int>& track : tracks) {
    const int landmark = segment.observations[track[0]].landmark;
    const auto error_px = [&](const Eigen::Vector3d& p_G) {
      return AppearanceError(rig, truth, track, track[2], p_G);
    };
    ASSERT_TRUE(selection.landmarks[landmark].allFinite());
    good += error_px(selection.landmarks[landmark]) <
            0.3 * error_px(segment.landmarks[landmark].p_G) + 0.5;
  }
  ASSERT_GT(tracks.size(), 50u);
  EXPECT_GT(good, 0.95 * static_cast<double>(tracks.size()));
}

TEST(SelectInliers, WithoutParallaxKeepsTheDistance) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment segment = RestingSegment(rig, 8);
  const InlierSelection selection = Select(rig, segment);
  for (std::size_t m = 0; m < segment.landmarks.size(); ++m) {
    EXPECT_LT((selection.landmarks[m] - segment.landmarks[m].p_G).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace selfcal
