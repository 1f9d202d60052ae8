// Properties of the score: section 4 of the method.
#include "core/information/segment_information.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/information/segment_scorer.h"
#include "core/simulation/simulate.h"
#include "test/core/information/test_segments.h"

namespace selfcal {
namespace {

void ExpectFinite(const SegmentInformation& score) {
  EXPECT_TRUE(score.Lambda.allFinite());
  EXPECT_TRUE(score.eta.allFinite());
  EXPECT_TRUE(score.Lambda == score.Lambda.transpose());
  for (const GroupScore& group : score.groups) {
    EXPECT_TRUE(std::isfinite(group.entropy));
    EXPECT_TRUE(std::isfinite(group.gain));
    EXPECT_GE(group.gain, 0);
    EXPECT_EQ(group.rank + static_cast<int>(group.unobserved.size()),
              group.size);
  }
}

void ExpectSameScores(const SegmentInformation& a,
                      const SegmentInformation& b,
                      double tolerance_nat) {
  ASSERT_EQ(a.groups.size(), b.groups.size());
  for (std::size_t q = 0; q < a.groups.size(); ++q) {
    EXPECT_NEAR(a.groups[q].entropy, b.groups[q].entropy, tolerance_nat);
    EXPECT_NEAR(a.groups[q].gain, b.groups[q].gain, tolerance_nat);
    EXPECT_EQ(a.groups[q].rank, b.groups[q].rank);
  }
  EXPECT_EQ(a.rank, b.rank);
}

void ExpectNoBetter(const SegmentInformation& less,
                    const SegmentInformation& more) {
  for (std::size_t q = 0; q < less.groups.size(); ++q) {
    EXPECT_GT(less.groups[q].entropy, more.groups[q].entropy - 1e-9);
  }
}

SegmentInformation Score(const Rig& rig, const MotionSegment& segment) {
  return ScoreSegment(rig, rig.factory, segment);
}

// A daemon scores the segments of all of its rigs with one workspace.
TEST(SegmentScorer, ServesRigsThatDifferInNothingButTheirShape) {
  const Rig plain = HandheldRig("plain");
  Rig rolling = plain;
  rolling.factory.cameras[0].line_delay_s = 3e-5;
  Rig fine = plain;  // twice the pixels
  CameraCalibration& camera = fine.factory.cameras[0];
  camera.width_px *= 2;
  camera.height_px *= 2;
  camera.f *= 2;
  camera.c *= 2;
  SegmentScorer scorer;
  for (const Rig& rig : {plain, rolling, fine, plain}) {
    const MotionSegment segment = MovingSegment(rig, 3);
    SegmentInformation shared;
    scorer.Score(rig, rig.factory, segment, {}, &shared);
    const SegmentInformation own = ScoreSegment(rig, rig.factory, segment);
    EXPECT_EQ(shared.Lambda, own.Lambda);
    ASSERT_EQ(shared.groups.size(), own.groups.size());
    for (std::size_t q = 0; q < own.groups.size(); ++q) {
      EXPECT_EQ(shared.groups[q].entropy, own.groups[q].entropy);
      EXPECT_EQ(shared.groups[q].size, own.groups[q].size);
    }
  }
}

TEST(ScoreSegment, DoesNotDependOnTheKeyframeThatHoldsTheGauge) {
  const Rig rig = HandheldRig("handheld");
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const MotionSegment segment = MovingSegment(rig, seed);
    const SegmentInformation first = Score(rig, segment);
    for (const int gauge : {1, 17, 39}) {
      ScoreOptions options;
      options.gauge_keyframe = gauge;
      ExpectSameScores(
          ScoreSegment(rig, rig.factory, segment, options), first, 1e-6);
    }
  }
}

// Samples beyond the keyframes change neither what is integrated between them
// nor any statistic.
TEST(ScoreSegment, DoesNotDependOnThePaddingWithoutATimeOffset) {
  const Rig rig = HandheldRig("handheld");
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const MotionSegment padded = MovingSegment(rig, seed);
    MotionSegment bare = padded;
    const auto from_first = SamplesFromFirstKeyframe(padded);
    const auto between = SamplesBetweenKeyframes(padded);
    // A segment that another followed always had these neighbours after its
    // last keyframe.
    bare.imu.assign(from_first.begin(),
                    from_first.begin() + between.size() + 8);
    ASSERT_LT(bare.imu.size(), padded.imu.size());
    const SegmentInformation with = Score(rig, padded);
    const SegmentInformation without = Score(rig, bare);
    EXPECT_EQ(with.Lambda, without.Lambda);
    EXPECT_EQ(with.eta, without.eta);
    EXPECT_EQ(with.residuals.fit, without.residuals.fit);
    ExpectSameScores(with, without, 0);
  }
}

TEST(ScoreSegment, CountsGapsBetweenItsKeyframesOnly) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 1);
  const std::int64_t last_ns = segment.keyframes.back().t_ns;
  const auto after = std::find_if(
      segment.imu.begin(), segment.imu.end(), [&](const ImuSample& sample) {
        return sample.t_ns > last_ns + 20'000'000;
      });
  ASSERT_GT(segment.imu.end() - after, 10);
  segment.imu.erase(after, after + 5);
  EXPECT_EQ(Score(rig, segment).residuals.imu_gaps, 0);
  const auto middle =
      segment.imu.begin() + static_cast<std::ptrdiff_t>(segment.imu.size() / 2);
  segment.imu.erase(middle, middle + 5);
  EXPECT_EQ(Score(rig, segment).residuals.imu_gaps, 1);
}

TEST(ScoreSegment, AtRestDoesNotDependOnTheGaugeEither) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment segment = RestingSegment(rig, 3);
  ScoreOptions options;
  options.gauge_keyframe = 20;
  ExpectSameScores(ScoreSegment(rig, rig.factory, segment, options),
                   Score(rig, segment),
                   1e-3);
}

TEST(ScoreSegment, DoesNotDependOnWhereTheSegmentLiesNorOnItsYaw) {
  const Rig rig = HandheldRig("handheld");
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const MotionSegment segment = MovingSegment(rig, seed);
    const Eigen::Vector3d offset_m(
        uniform(random), 10 * uniform(random), uniform(random));
    ExpectSameScores(Score(rig, Moved(segment, uniform(random), offset_m)),
                     Score(rig, segment),
                     1e-7);
  }
}

TEST(ScoreSegment, DoesNotDependOnTheOrderOfLandmarksAndObservations) {
  const Rig rig = TwoCameraRig();
  std::mt19937 random(2);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SimulationOptions options;
    options.seed = seed;
    options.outlier_fraction = 0.02;
    const MotionSegment segment =
        OneSegment(rig, rig.factory, *MakeHandheld(4.1, 1, seed), options).slam;
    const SegmentInformation expected = Score(rig, segment);
    const SegmentInformation actual = Score(rig, Shuffled(segment, &random));
    ExpectSameScores(actual, expected, 1e-8);
    EXPECT_EQ(actual.residuals.inliers, expected.residuals.inliers);
    EXPECT_EQ(actual.residuals.outliers, expected.residuals.outliers);
  }
}

TEST(ScoreSegment, TheSameInputGivesTheSameBits) {
  const Rig rig = TwoCameraRig();
  const MotionSegment segment = MovingSegment(rig, 5);
  const SegmentInformation a = Score(rig, segment);
  const SegmentInformation b = Score(rig, segment);
  EXPECT_TRUE(a.Lambda == b.Lambda);
  EXPECT_TRUE(a.eta == b.eta);
}

TEST(ScoreSegment, MoreObservationsNeverRaiseTheEntropy) {
  const Rig rig = HandheldRig("handheld");
  std::mt19937 random(3);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const MotionSegment all = MovingSegment(rig, seed);
    MotionSegment fewer = all;
    std::bernoulli_distribution drop(seed % 2 ? 0.02 : 0.6);
    std::erase_if(fewer.observations,
                  [&](const Observation&) { return drop(random); });
    ExpectNoBetter(Score(rig, fewer), Score(rig, all));
  }
}

TEST(ScoreSegment, AnotherKeyframeNeverRaisesTheEntropy) {
  const Rig rig = HandheldRig("handheld");
  MotionSegment segment = MovingSegment(rig, 4);
  SegmentInformation more = Score(rig, segment);
  while (segment.keyframes.size() > 2) {
    segment = WithoutLastKeyframe(segment);
    const SegmentInformation less = Score(rig, segment);
    ExpectFinite(less);
    ExpectNoBetter(less, more);
    more = less;
  }
}

TEST(ScoreSegment, AMovingSegmentObservesTheCameraAndGainsForEveryGroup) {
  for (const Rig& rig : {HandheldRig("handheld"), TwoCameraRig()}) {
    const SegmentInformation score = Score(rig, MovingSegment(rig, 6));
    ExpectFinite(score);
    for (const GroupScore& group : score.groups) {
      EXPECT_GT(group.gain, 1) << group.group;
      EXPECT_GT(group.rank, group.size / 2) << group.group;
    }
    EXPECT_FALSE(score.residuals.many_outliers);
    EXPECT_EQ(score.residuals.inliers, score.residuals.observations);
  }
}

TEST(ScoreSegment, ADeviceAtRestHasNoInformationAboutTheImuAndNamesIt) {
  const Rig rig = HandheldRig("handheld");
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const SegmentInformation score = Score(rig, RestingSegment(rig, seed));
    ExpectFinite(score);
    const GroupScore& imu = score.groups[0];
    ASSERT_EQ(imu.group, "imu");
    EXPECT_LT(imu.gain, 0.1);
    EXPECT_EQ(imu.rank, 0);
    ASSERT_EQ(imu.unobserved.size(), 15u);
    for (const UnobservedDirection& direction : imu.unobserved) {
      ASSERT_FALSE(direction.parts.empty());
      EXPECT_THAT(direction.parts[0].component, testing::StartsWith("imu."));
      EXPECT_GT(direction.parts[0].weight, 0);
      EXPECT_GE(direction.information_ratio, 0);
      EXPECT_LT(direction.information_ratio, 1);
    }
    EXPECT_LT(score.rank, 26);
    EXPECT_EQ(score.rank + score.unobserved.size(), 26u);
  }
}

TEST(ScoreSegment, WithoutObservationsOnlyTheWeakPriorsRemain) {
  const Rig rig = HandheldRig("handheld");
  for (MotionSegment segment :
       {MovingSegment(rig, 1), RestingSegment(rig, 1)}) {
    segment.observations.clear();
    for (const bool landmarks : {true, false}) {
      if (!landmarks) segment.landmarks.clear();
      const SegmentInformation score = Score(rig, segment);
      ExpectFinite(score);
      EXPECT_LT(score.groups[0].gain, 0.1);
      EXPECT_EQ(score.groups[1].gain, 0);
      EXPECT_EQ(score.groups[2].gain, 0);
      EXPECT_EQ(score.rank, 0);
      EXPECT_FALSE(score.residuals.many_outliers);
      EXPECT_EQ(score.residuals.landmarks_used, 0);
    }
  }
}

// A body in free fall: gravity is unobservable.
TEST(ScoreSegment, FreeFallStaysFinite) {
  Rig rig = HandheldRig("handheld");
  rig.factory.imu = {};
  MotionSegment segment = RestingSegment(rig, 1);
  segment.observations.clear();
  const double g = rig.gravity_mps2;
  for (ImuSample& sample : segment.imu) {
    sample.gyro.setZero();
    sample.accel.setZero();
  }
  for (KeyframeState& x : segment.keyframes) {
    const double t_s =
        1e-9 * static_cast<double>(x.t_ns - segment.keyframes[0].t_ns);
    x.v_GI = {0, 0, -g * t_s};
    x.p_GI = {0, 0, -0.5 * g * t_s * t_s};
    x.b_a.setZero();
    x.b_g.setZero();
  }
  const SegmentInformation score = Score(rig, segment);
  ExpectFinite(score);
  EXPECT_LT(score.groups[0].gain, 0.1);
}

TEST(ScoreSegment, AKeyframeWithoutObservationsIsHeldByTheInertialFactors) {
  const Rig rig = HandheldRig("handheld");
  const MotionSegment all = MovingSegment(rig, 2);
  const SegmentInformation full = Score(rig, all);
  for (const int blind : {0, 20, 39}) {
    MotionSegment segment = all;
    std::erase_if(segment.observations,
                  [&](const Observation& o) { return o.keyframe == blind; });
    const SegmentInformation score = Score(rig, segment);
    ExpectFinite(score);
    ExpectNoBetter(score, full);
    for (std::size_t q = 0; q < score.groups.size(); ++q) {
      EXPECT_NEAR(score.groups[q].entropy, full.groups[q].entropy, 1.5);
    }
  }
}

TEST(ScoreSegment, FixedComponentsHaveZeroRowsAndLeaveTheirGroup) {
  Rig rig = HandheldRig("handheld");
  const MotionSegment segment = MovingSegment(rig, 8);
  const SegmentInformation free = Score(rig, segment);
  rig.fixed = {"imu.gyro.*", "cam0.p_CI.y"};
  const SegmentInformation held = Score(rig, segment);
  ExpectFinite(held);
  const std::vector<int> fixed =
      MatchComponents(TangentComponents(rig.factory), rig.fixed);
  EXPECT_TRUE(held.Lambda(fixed, Eigen::all).isZero(0));
  EXPECT_TRUE(held.eta(fixed).isZero(0));
  EXPECT_EQ(held.groups[0].size, 9);
  EXPECT_EQ(held.groups[2].size, 5);
  // Known components improve the others.
  EXPECT_LE(held.groups[1].entropy, free.groups[1].entropy + 1e-9);
  // A group of which nothing is left.
  rig.fixed = {"imu.*"};
  const SegmentInformation none = Score(rig, segment);
  ExpectFinite(none);
  EXPECT_EQ(none.groups[0].size, 0);
  EXPECT_EQ(none.groups[0].entropy, 0);
}

// Biases that cannot walk: differences known far better than their mean.
TEST(ScoreSegment, TightDensitiesNeverBreakIt) {
  Rig rig = HandheldRig("handheld");
  for (const double walk : {1e-7, 1e-9, 1e-12}) {
    rig.imu_noise.gyro_bias_random_walk = walk;
    rig.imu_noise.accel_bias_random_walk = walk;
    for (MotionSegment segment :
         {MovingSegment(rig, 1), RestingSegment(rig, 1)}) {
      ExpectFinite(Score(rig, segment));
      segment.observations.clear();
      const SegmentInformation blind = Score(rig, segment);
      ExpectFinite(blind);
      EXPECT_EQ(blind.rank, 0);
    }
  }
}

TEST(ScoreSegment, CountsTheGapsBetweenSamples) {
  Rig rig = HandheldRig("a");
  SimulationOptions options;
  const auto statistics = [&] {
    return ScoreSegment(rig,
                        rig.factory,
                        Simulate(rig,
                                 rig.factory,
                                 rig.factory,
                                 *MakeHandheld(4.5, 0.5, 1),
                                 "session",
                                 options)
                            .segments[0])
        .residuals;
  };
  EXPECT_EQ(statistics().imu_gaps, 0);
  EXPECT_EQ(statistics().longest_imu_gap_s, 0);
  options.imu_gap_s = 0.1;
  EXPECT_EQ(statistics().imu_gaps, 1);
  EXPECT_NEAR(statistics().longest_imu_gap_s, 0.1, 0.0051);
}

TEST(ScoreSegment, ARealisticSlamSegmentKeepsItsObservations) {
  const Rig rig = HandheldRig("handheld");
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options;
    options.seed = seed;
    const Calibration theta = PerturbCalibration(rig.factory, {}, seed);
    const SegmentPair pair =
        OneSegment(rig, theta, *MakeHandheld(4.1, 1, seed), options);
    const SegmentInformation score = ScoreSegment(rig, theta, pair.slam);
    ExpectFinite(score);
    EXPECT_FALSE(score.residuals.many_outliers);
    EXPECT_GT(score.residuals.inliers, 0.95 * score.residuals.observations);
    // The entropy hardly depends on the errors of the linearisation point.
    const SegmentInformation truth = Score(rig, pair.truth);
    for (std::size_t q = 0; q < score.groups.size(); ++q) {
      EXPECT_NEAR(score.groups[q].entropy,
                  truth.groups[q].entropy,
                  0.15 * score.groups[q].size);
    }
  }
}

// The remaining squares at the minimum over states, landmarks and theta are
// those of the noise, also from a factory calibration.
TEST(ScoreSegment, FitIsOneIfNoiseIsAsStated) {
  const Rig device = HandheldRig("handheld");
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Rig rig = device;
    rig.factory = PerturbCalibration(device.factory, {}, seed);
    SimulationOptions options;
    options.seed = seed;
    const MotionSegment segment = Simulate(rig,
                                           device.factory,
                                           rig.factory,
                                           *MakeHandheld(4.1, 0.7, seed),
                                           "session",
                                           options)
                                      .segments.front();
    const SegmentInformation score = Score(rig, segment);
    EXPECT_NEAR(score.residuals.fit, 1, 0.05);
    Rig surer = rig;
    surer.pixel_sigma_px /= 3;
    const SegmentInformation sure = Score(surer, segment);
    EXPECT_NEAR(sure.residuals.fit, 3, 0.3);
  }
}

// One reading at the limit of the sensor's range makes motion look vigorous;
// its information has almost no weight.
TEST(ScoreSegment, InformationIsReducedIfTheSegmentDoesNotFit) {
  const Rig rig = HandheldRig("handheld");
  SimulationOptions options;
  options.seed = 3;
  MotionSegment segment = Simulate(rig,
                                   rig.factory,
                                   rig.factory,
                                   *MakeHandheld(4.1, 0.3, 3),
                                   "session",
                                   options)
                              .segments.front();
  const SegmentInformation good = Score(rig, segment);
  segment.imu[segment.imu.size() / 2].gyro.x() = 100;
  const SegmentInformation bad = Score(rig, segment);
  EXPECT_LT(good.residuals.fit, 1.1);
  EXPECT_GT(bad.residuals.fit, 2 * kOrdinaryFit);
  for (std::size_t q = 0; q < good.groups.size(); ++q) {
    EXPECT_LT(bad.groups[q].gain, good.groups[q].gain);
  }
}

// Memory grows with the square of the length of tracks.
TEST(ScoreSegment, TracksThroughTooManyKeyframesAreRefused) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  options.keyframe_rate_hz = 100;
  options.landmarks_in_view = 20;
  options.mean_track_length = 1e6;
  options.keyframes_per_segment = 300;
  ExpectFinite(
      ScoreSegment(rig, rig.factory, TrueSegment(rig, *MakeRest(4), options)));
  options.keyframes_per_segment = 800;
  const MotionSegment longer = TrueSegment(rig, *MakeRest(9), options);
  try {
    ScoreSegment(rig, rig.factory, longer);
    FAIL() << "scored";
  } catch (const std::length_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("send fewer keyframes"));
  }
}

}  // namespace
}  // namespace selfcal
