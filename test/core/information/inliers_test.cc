#include "core/information/inliers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "core/factor/reprojection.h"
#include "core/information/refine_landmark.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

InlierSelection Select(const Rig& rig, const MotionSegment& segment) {
  return SelectInliers(rig.factory, rig.pixel_sigma_px, segment, {});
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

// The calibration is a factory's, states and landmarks are a SLAM system's.
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
    const InlierSelection selection =
        SelectInliers(theta, rig.pixel_sigma_px, pair.slam, {});
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

TEST(SelectInliers, APointBehindTheCameraIsCountedAndLeftOut) {
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

// Root mean square distance [px] of where two points appear in a track, but for
// its observation `except`.
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

TEST(RefineLandmark, BringsANoisyLandmarkBackAlthoughOneObservationIsWrong) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment truth = MovingSegment(rig, 7);
  std::vector<std::vector<int>> tracks(truth.landmarks.size());
  for (int i = 0; i < static_cast<int>(truth.observations.size()); ++i) {
    tracks[truth.observations[i].landmark].push_back(i);
  }
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 0.05);
  int tried = 0, good = 0;
  for (std::size_t m = 0; m < tracks.size(); ++m) {
    if (tracks[m].size() < 8) continue;
    MotionSegment segment = truth;
    const int wrong = tracks[m][2];
    segment.observations[wrong].z_px += Eigen::Vector2d(60, -45);
    const int first = segment.observations[tracks[m][0]].keyframe;
    const double distance_m =
        (truth.landmarks[m].p_G - truth.keyframes[first].p_GI).norm();
    const Eigen::Vector3d start_G =
        truth.landmarks[m].p_G + distance_m * Eigen::Vector3d(normal(random),
                                                              normal(random),
                                                              normal(random));
    const double before_px =
        AppearanceError(rig, truth, tracks[m], wrong, start_G);
    const Eigen::Vector3d refined_G = RefineLandmark(
        rig.factory, rig.pixel_sigma_px, segment, tracks[m], start_G);
    ASSERT_TRUE(refined_G.allFinite());
    ++tried;
    good += AppearanceError(rig, truth, tracks[m], wrong, refined_G) <
            0.3 * before_px + 0.5;
  }
  ASSERT_GT(tried, 50);
  EXPECT_GT(good, 0.95 * tried);
}

TEST(RefineLandmark, WithoutParallaxKeepsTheDistance) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment segment = RestingSegment(rig, 8);
  const InlierSelection selection = Select(rig, segment);
  for (std::size_t m = 0; m < segment.landmarks.size(); ++m) {
    EXPECT_LT((selection.landmarks[m] - segment.landmarks[m].p_G).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace selfcal
