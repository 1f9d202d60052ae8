#include "core/simulation/simulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

TEST(SimulateTest, SegmentsKeepAllRules) {
  for (const Rig& rig : {HandheldRig("a"), StereoRig()}) {
    ASSERT_TRUE(Validate(rig).empty());
    SimulationOptions options;
    options.outlier_fraction = 0.05;
    const SimulatedSession session = SimulateHandheld(rig, 60, options);
    ASSERT_EQ(session.segments.size(), 15u);
    ASSERT_EQ(session.truth.size(), 15u);
    for (std::size_t s = 0; s < session.segments.size(); ++s) {
      for (const MotionSegment* segment :
           {&session.segments[s], &session.truth[s]}) {
        for (const Violation& violation : Validate(*segment, rig.factory)) {
          ADD_FAILURE() << violation.field << ": " << violation.message;
        }
        EXPECT_EQ(segment->key,
                  (SegmentKey{"session", static_cast<std::int64_t>(s)}));
        EXPECT_EQ(segment->calibration_version, 1);
        EXPECT_EQ(segment->keyframes.size(), 40u);
      }
    }
  }
}

TEST(SimulateTest, SegmentsOfASecondImuWithATimeOffsetKeepThem) {
  Rig rig = HandheldRig("a");
  AddSecondImu(&rig);
  for (const double offset_s : {-kMaxSecondOffset_s, kMaxSecondOffset_s}) {
    rig.factory.imu1->time_offset_s = offset_s;
    const SimulatedSession session = SimulateHandheld(rig, 12, {});
    ASSERT_GE(session.segments.size(), 2u);
    for (const MotionSegment& segment : session.segments) {
      EXPECT_TRUE(Validate(segment, rig.factory).empty());
    }
  }
}

TEST(SimulateTest, EveryLandmarkOfASegmentIsObservedThereAtLeastThreeTimes) {
  const SimulatedSession session = SimulateHandheld(StereoRig(), 40, {});
  ASSERT_FALSE(session.segments.empty());
  for (const MotionSegment& segment : session.segments) {
    EXPECT_GT(segment.landmarks.size(), 300u);
    std::vector<int> seen(segment.landmarks.size(), 0);
    for (const Observation& z : segment.observations) ++seen[z.landmark];
    for (const int n : seen) EXPECT_GE(n, kMinSegmentObservations);
  }
}

TEST(SimulateTest, ImuReachesToTheNextSegmentAndJoinsWithoutASeam) {
  const SimulatedSession session = SimulateHandheld(HandheldRig("a"), 30, {});
  ASSERT_EQ(session.segments.size(), 7u);
  for (std::size_t s = 0; s < session.segments.size(); ++s) {
    const MotionSegment& segment = session.segments[s];
    EXPECT_LE(segment.imu.front().t_ns, segment.keyframes.front().t_ns);
    if (s + 1 == session.segments.size()) {
      EXPECT_GE(segment.imu.back().t_ns, segment.keyframes.back().t_ns);
      continue;
    }
    const MotionSegment& next = session.segments[s + 1];
    EXPECT_GE(segment.imu.back().t_ns, next.keyframes.front().t_ns);
    // The overlap, from 0.15 s before the next keyframe to 0.15 s after the
    // last one, is identical.
    const auto first = std::find_if(
        segment.imu.begin(), segment.imu.end(), [&](const ImuSample& sample) {
          return sample.t_ns == next.imu.front().t_ns;
        });
    const auto padding_ns = static_cast<std::int64_t>(kImuPadding_s * 1e9);
    EXPECT_LE(next.imu[0].t_ns, next.keyframes.front().t_ns - padding_ns);
    EXPECT_GT(next.imu[1].t_ns, next.keyframes.front().t_ns - padding_ns);
    EXPECT_GE(segment.imu.back().t_ns,
              segment.keyframes.back().t_ns + padding_ns);
    ASSERT_GT(segment.imu.end() - first, 2);
    for (auto sample = first; sample != segment.imu.end(); ++sample) {
      const ImuSample& same = next.imu[sample - first];
      EXPECT_EQ(sample->t_ns, same.t_ns);
      EXPECT_EQ(sample->accel, same.accel);
      EXPECT_EQ(sample->gyro, same.gyro);
    }
  }
}

TEST(SimulateTest, LostSamplesAreMissingAndAllElseIsUnchanged) {
  const Rig rig = HandheldRig("a");
  const auto simulate = [&](double lost_fraction, double gap_s) {
    SimulationOptions options;
    options.imu_padding_s = 0;  // of which none is lost
    options.imu_lost_fraction = lost_fraction;
    options.imu_gap_s = gap_s;
    return Simulate(rig,
                    rig.factory,
                    rig.factory,
                    *MakeHandheld(13, 0.5, 1),
                    "session",
                    options);
  };
  const SimulatedSession all = simulate(0, 0);
  const SimulatedSession lost = simulate(0.05, 0);
  const SimulatedSession gaps = simulate(0, 0.1);
  ASSERT_EQ(all.segments.size(), 3u);
  for (std::size_t s = 0; s < all.segments.size(); ++s) {
    const MotionSegment& whole = all.segments[s];
    for (const SimulatedSession* session : {&lost, &gaps}) {
      const MotionSegment& segment = session->segments[s];
      EXPECT_TRUE(Validate(segment, rig.factory).empty());
      EXPECT_EQ(segment.imu.front().t_ns, whole.imu.front().t_ns);
      EXPECT_EQ(segment.imu.back().t_ns, whole.imu.back().t_ns);
      ASSERT_EQ(segment.imu.size(), session->truth[s].imu.size());
      std::size_t i = 0;
      for (const ImuSample& sample : segment.imu) {
        while (whole.imu[i].t_ns < sample.t_ns) ++i;
        EXPECT_EQ(sample.gyro, whole.imu[i].gyro);
      }
      EXPECT_EQ(segment.keyframes[3].p_GI, whole.keyframes[3].p_GI);
    }
    const auto count = static_cast<double>(whole.imu.size());
    EXPECT_NEAR(static_cast<double>(lost.segments[s].imu.size()),
                0.95 * count,
                4 * std::sqrt(0.05 * count));
    // 19 or 20 samples lie within 100 ms.
    EXPECT_NEAR(
        static_cast<double>(gaps.segments[s].imu.size()), count - 19.5, 0.6);
    double longest_s = 0;
    for (std::size_t i = 1; i < gaps.segments[s].imu.size(); ++i) {
      longest_s = std::max(
          longest_s,
          1e-9 * static_cast<double>(gaps.segments[s].imu[i].t_ns -
                                     gaps.segments[s].imu[i - 1].t_ns));
    }
    EXPECT_NEAR(longest_s, 0.1, 0.0051);
  }
}

TEST(SimulateTest, KeyframesDoNotCoincideWithSamples) {
  const SimulatedSession session = SimulateHandheld(HandheldRig("a"), 20, {});
  ASSERT_FALSE(session.segments.empty());
  for (const MotionSegment& segment : session.segments) {
    std::set<std::int64_t> samples;
    for (const ImuSample& sample : segment.imu) samples.insert(sample.t_ns);
    for (const KeyframeState& x : segment.keyframes) {
      EXPECT_EQ(samples.count(x.t_ns), 0u);
    }
  }
}

TEST(SimulateTest, SegmentsShareLandmarksWithTheirNeighboursAndWithOlderOnes) {
  const SimulatedSession session = SimulateHandheld(HandheldRig("a"), 60, {});
  const auto ids = [&](std::size_t s) {
    std::set<std::uint64_t> ids;
    for (const Landmark& landmark : session.segments[s].landmarks) {
      ids.insert(landmark.id);
    }
    EXPECT_EQ(ids.size(), session.segments[s].landmarks.size());
    return ids;
  };
  const auto shared = [&](std::size_t a, std::size_t b) {
    const std::set<std::uint64_t> in_a = ids(a);
    int count = 0;
    for (const std::uint64_t id : ids(b)) count += in_a.count(id) > 0;
    return count;
  };
  int with_older = 0;
  for (std::size_t s = 1; s < session.segments.size(); ++s) {
    EXPECT_GT(shared(s - 1, s), 40);
    for (std::size_t r = 0; r + 1 < s; ++r) with_older += shared(r, s);
  }
  EXPECT_GT(with_older, 100);
}

TEST(SimulateTest, ALandmarkIsTheSamePointInEverySegment) {
  const SimulatedSession session = SimulateHandheld(HandheldRig("a"), 30, {});
  std::map<std::uint64_t, Eigen::Vector3d> estimated;
  std::map<std::uint64_t, Eigen::Vector3d> true_G;
  int again = 0;
  for (std::size_t s = 0; s < session.segments.size(); ++s) {
    for (std::size_t m = 0; m < session.segments[s].landmarks.size(); ++m) {
      const Landmark& landmark = session.segments[s].landmarks[m];
      const Landmark& truth = session.truth[s].landmarks[m];
      ASSERT_EQ(landmark.id, truth.id);
      const auto [it, is_new] = estimated.emplace(landmark.id, landmark.p_G);
      again += is_new ? 0 : 1;
      EXPECT_EQ(it->second, landmark.p_G);
      EXPECT_EQ(true_G.emplace(truth.id, truth.p_G).first->second, truth.p_G);
    }
  }
  EXPECT_GT(again, 0) << "no landmark is in two segments";
}

void ExpectSameBits(const MotionSegment& a, const MotionSegment& b) {
  ASSERT_EQ(a.keyframes.size(), b.keyframes.size());
  for (std::size_t k = 0; k < a.keyframes.size(); ++k) {
    EXPECT_EQ(a.keyframes[k].t_ns, b.keyframes[k].t_ns);
    EXPECT_EQ(a.keyframes[k].q_GI.coeffs(), b.keyframes[k].q_GI.coeffs());
    EXPECT_EQ(a.keyframes[k].b_a, b.keyframes[k].b_a);
  }
  ASSERT_EQ(a.imu.size(), b.imu.size());
  for (std::size_t i = 0; i < a.imu.size(); ++i) {
    EXPECT_EQ(a.imu[i].accel, b.imu[i].accel);
  }
  ASSERT_EQ(a.landmarks.size(), b.landmarks.size());
  for (std::size_t m = 0; m < a.landmarks.size(); ++m) {
    EXPECT_EQ(a.landmarks[m].p_G, b.landmarks[m].p_G);
  }
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (std::size_t i = 0; i < a.observations.size(); ++i) {
    EXPECT_EQ(a.observations[i].z_px, b.observations[i].z_px);
  }
}

TEST(SimulateTest, TheSameSeedGivesTheSameBitsAndAnotherSeedDoesNot) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  const SimulatedSession a = SimulateHandheld(rig, 15, options);
  const SimulatedSession b = SimulateHandheld(rig, 15, options);
  ASSERT_EQ(a.segments.size(), b.segments.size());
  for (std::size_t s = 0; s < a.segments.size(); ++s) {
    ExpectSameBits(a.segments[s], b.segments[s]);
    ExpectSameBits(a.truth[s], b.truth[s]);
  }
  options.seed = 2;
  const SimulatedSession c = SimulateHandheld(rig, 15, options);
  EXPECT_NE(a.segments[0].imu[0].accel, c.segments[0].imu[0].accel);
}

TEST(SimulateTest, MoreOutliersLeaveAllOtherNoiseUnchanged) {
  const Rig rig = HandheldRig("a");
  SimulationOptions options;
  const SimulatedSession clean = SimulateHandheld(rig, 15, options);
  options.outlier_fraction = 0.2;
  const SimulatedSession dirty = SimulateHandheld(rig, 15, options);
  EXPECT_EQ(clean.segments[1].imu[7].accel, dirty.segments[1].imu[7].accel);
  EXPECT_EQ(clean.segments[1].keyframes[7].p_GI,
            dirty.segments[1].keyframes[7].p_GI);
}

TEST(SimulateTest, ARestLongEnoughGivesSegmentsWithLandmarksNearTheTruth) {
  const Rig rig = HandheldRig("a");
  const SimulatedSession session =
      Simulate(rig,
               rig.factory,
               PerturbCalibration(rig.factory, {}, 4),
               *MakeRest(9),
               "rest",
               {});
  ASSERT_EQ(session.segments.size(), 2u);
  for (std::size_t s = 0; s < 2; ++s) {
    const MotionSegment& truth = session.truth[s];
    ASSERT_GT(truth.landmarks.size(), 200u);
    double relative = 0;
    for (std::size_t m = 0; m < truth.landmarks.size(); ++m) {
      const Eigen::Vector3d& p_G = truth.landmarks[m].p_G;
      const double depth_m = (p_G - truth.keyframes[0].p_GI).norm();
      relative += (session.segments[s].landmarks[m].p_G - p_G).norm() / depth_m;
    }
    EXPECT_LT(relative / static_cast<double>(truth.landmarks.size()), 0.1);
  }
}

TEST(SimulateTest, ATrajectoryTooShortForASegmentGivesNone) {
  const Rig rig = HandheldRig("a");
  const SimulatedSession session =
      Simulate(rig, rig.factory, rig.factory, *MakeRest(3.9), "short", {});
  EXPECT_TRUE(session.segments.empty());
  EXPECT_TRUE(session.truth.empty());
}

}  // namespace
}  // namespace selfcal
