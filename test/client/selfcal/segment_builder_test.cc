#include "client/selfcal/segment_builder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "core/model/calibration.h"

namespace selfcal::client {
namespace {

constexpr std::int64_t kMs = 1'000'000;

// A random session: keyframes at uneven times, an IMU at about 200 Hz whose
// samples do not fall on them, landmarks that come and go.
struct Session {
  std::vector<ImuSample> imu;
  std::vector<KeyframeState> states;
  std::vector<std::vector<KeyframeObservation>> observations;
};

Session RandomSession(std::mt19937& random, int keyframes) {
  std::uniform_int_distribution<std::int64_t> keyframe_gap(40 * kMs, 200 * kMs);
  std::uniform_int_distribution<std::int64_t> imu_gap(4 * kMs, 6 * kMs);
  std::uniform_real_distribution<double> pixel(1, 600);
  std::normal_distribution<double> normal;
  Session session;
  std::int64_t t = 1'000'000'000;
  for (int k = 0; k < keyframes; ++k, t += keyframe_gap(random)) {
    KeyframeState state;
    state.t_ns = t;
    state.p_GI = {normal(random), normal(random), normal(random)};
    session.states.push_back(state);
    std::vector<KeyframeObservation> seen;
    for (std::uint64_t id = static_cast<std::uint64_t>(k);
         id < static_cast<std::uint64_t>(k) + 12;
         ++id) {
      for (std::int32_t camera = 0; camera < 2; ++camera) {
        if (random() % 4 == 0) continue;
        seen.push_back({camera,
                        id,
                        {pixel(random), pixel(random) / 2},
                        {normal(random), normal(random), 5}});
      }
    }
    std::shuffle(seen.begin(), seen.end(), random);
    session.observations.push_back(seen);
  }
  for (std::int64_t s = 1'000'000'000 - 3 * kMs; s < t; s += imu_gap(random)) {
    session.imu.push_back({s,
                           {normal(random), normal(random), normal(random)},
                           {normal(random), normal(random), 9.81}});
  }
  return session;
}

Calibration TwoCameras() {
  Calibration theta;
  theta.cameras.resize(2);
  for (CameraCalibration& camera : theta.cameras) {
    camera.f = {300, 300};
    camera.c = {320, 240};
    camera.distortion << 0.9;
    camera.width_px = 640;
    camera.height_px = 480;
  }
  return theta;
}

void TakeAll(SegmentBuilder& builder, std::vector<MotionSegment>* segments) {
  while (auto segment = builder.Take()) {
    segments->push_back(*std::move(segment));
  }
}

// Feeds both streams by time, the IMU late or early by `imu_delay_ns`.
std::vector<MotionSegment> Build(const Session& session,
                                 const SegmentBuilderOptions& options,
                                 std::int64_t imu_delay_ns) {
  SegmentBuilder builder(options);
  std::vector<MotionSegment> segments;
  std::size_t next = 0;
  for (std::size_t k = 0; k < session.states.size(); ++k) {
    const std::int64_t now = session.states[k].t_ns - imu_delay_ns;
    for (; next < session.imu.size() && session.imu[next].t_ns <= now; ++next) {
      EXPECT_TRUE(builder.AddImu(session.imu[next]));
      TakeAll(builder, &segments);
    }
    EXPECT_TRUE(
        builder.AddKeyframe(session.states[k], session.observations[k]));
    TakeAll(builder, &segments);
  }
  for (; next < session.imu.size(); ++next) builder.AddImu(session.imu[next]);
  builder.Flush(2);
  TakeAll(builder, &segments);
  return segments;
}

SegmentBuilderOptions Options() {
  SegmentBuilderOptions options;
  options.session = "session";
  return options;
}

std::vector<std::int64_t> Times(const std::vector<ImuSample>& samples) {
  std::vector<std::int64_t> times;
  for (const ImuSample& sample : samples) times.push_back(sample.t_ns);
  return times;
}

// The samples from the last one at or before `begin` to the first one at or
// after `end`, by looking at each.
std::vector<std::int64_t> Covering(const std::vector<ImuSample>& imu,
                                   std::int64_t begin,
                                   std::int64_t end) {
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i < imu.size(); ++i) {
    const bool is_before = i + 1 < imu.size() && imu[i + 1].t_ns <= begin;
    const bool is_after = i > 0 && imu[i - 1].t_ns >= end;
    if (!is_before && !is_after) times.push_back(imu[i].t_ns);
  }
  return times;
}

TEST(SegmentBuilder, PutsEveryKeyframeIntoExactlyOneSegment) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const int keyframes = 2 + static_cast<int>(random() % 120);
    const Session session = RandomSession(random, keyframes);
    SegmentBuilderOptions options = Options();
    options.keyframes = 2 + static_cast<int>(random() % 40);
    options.first_index = 5;
    const std::int64_t delay = (static_cast<int>(random() % 600) - 300) * kMs;
    const auto segments = Build(session, options, delay);

    std::vector<std::int64_t> times;
    std::int64_t index = 5;
    for (const MotionSegment& segment : segments) {
      EXPECT_EQ(segment.key, (SegmentKey{"session", index++}));
      for (const KeyframeState& state : segment.keyframes) {
        times.push_back(state.t_ns);
      }
    }
    // A single keyframe at the end is not a segment.
    const int rest = keyframes % options.keyframes;
    ASSERT_EQ(times.size(),
              static_cast<std::size_t>(rest == 1 ? keyframes - 1 : keyframes));
    for (std::size_t k = 0; k < times.size(); ++k) {
      EXPECT_EQ(times[k], session.states[k].t_ns);
    }
    for (std::size_t s = 0; s + 1 < segments.size(); ++s) {
      EXPECT_EQ(segments[s].keyframes.size(),
                static_cast<std::size_t>(options.keyframes));
    }
  }
}

TEST(SegmentBuilder, BuildsSegmentsThatAreValid) {
  std::mt19937 random(2);
  const Calibration theta = TwoCameras();
  for (int trial = 0; trial < 60; ++trial) {
    const Session session = RandomSession(random, 90);
    SegmentBuilderOptions options = Options();
    options.keyframes = 2 + static_cast<int>(random() % 40);
    options.min_observations = static_cast<int>(random() % 6);
    const std::int64_t delay = (static_cast<int>(random() % 600) - 300) * kMs;
    const auto segments = Build(session, options, delay);
    EXPECT_FALSE(segments.empty());
    for (const MotionSegment& segment : segments) {
      const auto violations = Validate(segment, theta);
      EXPECT_TRUE(violations.empty())
          << violations.front().field << " " << violations.front().message;
    }
  }
}

TEST(SegmentBuilder, GivesEachSegmentTheSamplesUpToItsSuccessorAndThePadding) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 60; ++trial) {
    const Session session = RandomSession(random, 100);
    SegmentBuilderOptions options = Options();
    if (trial % 2 == 0) options.padding_s = 0;
    const auto padding_ns =
        static_cast<std::int64_t>(options.padding_s * 1000) * kMs;
    options.keyframes = 2 + static_cast<int>(random() % 40);
    const std::int64_t delay = (static_cast<int>(random() % 600) - 300) * kMs;
    const auto segments = Build(session, options, delay);
    std::size_t next = 0;
    for (const MotionSegment& segment : segments) {
      next += segment.keyframes.size();
      const std::int64_t end = std::max(
          session.states[std::min(next, session.states.size() - 1)].t_ns,
          segment.keyframes.back().t_ns + padding_ns);
      EXPECT_EQ(
          Times(segment.imu),
          Covering(
              session.imu, segment.keyframes.front().t_ns - padding_ns, end));
    }
  }
}

TEST(SegmentBuilder, DoesNotDependOnWhetherTheImuLagsOrLeads) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 30; ++trial) {
    const Session session = RandomSession(random, 100);
    const auto leading = Build(session, Options(), -300 * kMs);
    const auto lagging = Build(session, Options(), 300 * kMs);
    ASSERT_GT(leading.size(), 0u);
    ASSERT_EQ(leading.size(), lagging.size());
    for (std::size_t s = 0; s < leading.size(); ++s) {
      EXPECT_EQ(leading[s].keyframes.size(), lagging[s].keyframes.size());
      EXPECT_EQ(Times(leading[s].imu), Times(lagging[s].imu));
      EXPECT_EQ(leading[s].observations.size(), lagging[s].observations.size());
    }
  }
}

// The samples of the second IMU lag behind those of the first.
TEST(SegmentBuilder, GivesEachSegmentTheSamplesOfASecondImu) {
  std::mt19937 random(21);
  Calibration theta = TwoCameras();
  theta.imu1.emplace();
  const Session session = RandomSession(random, 200);
  SegmentBuilder builder(Options());
  std::vector<MotionSegment> segments;
  std::size_t first = 0, second = 0;
  const auto feed = [&](std::int64_t now_ns) {
    for (; first < session.imu.size() && session.imu[first].t_ns <= now_ns;
         ++first) {
      EXPECT_TRUE(builder.AddImu(session.imu[first]));
    }
    for (; second < first && session.imu[second].t_ns <= now_ns - 300 * kMs;
         ++second) {
      ImuSample sample = session.imu[second];
      sample.t_ns += kMs;
      EXPECT_TRUE(builder.AddSecondImu(sample));
    }
  };
  for (std::size_t k = 0; k < session.states.size(); ++k) {
    feed(session.states[k].t_ns);
    builder.AddKeyframe(session.states[k], session.observations[k]);
    TakeAll(builder, &segments);
  }
  feed(session.states.back().t_ns + 1000 * kMs);
  builder.Flush(2);
  TakeAll(builder, &segments);
  ASSERT_EQ(segments.size(), 5u);
  std::size_t keyframes = 0;
  for (const MotionSegment& segment : segments) {
    const auto violations = Validate(segment, theta);
    EXPECT_TRUE(violations.empty())
        << violations.front().field << " " << violations.front().message;
    keyframes += segment.keyframes.size();
    // Neighbours can be joined by the samples of both.
    EXPECT_NEAR(static_cast<double>(segment.imu.back().t_ns),
                static_cast<double>(segment.imu1.back().t_ns),
                10.0 * kMs);
  }
  EXPECT_GE(keyframes, 197u);  // those that both cover
  EXPECT_FALSE(builder.AddSecondImu({}));
}

TEST(SegmentBuilder, ClosesBySecondsWhenAsked) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 30; ++trial) {
    const Session session = RandomSession(random, 150);
    SegmentBuilderOptions options = Options();
    options.keyframes = 3;  // does not matter then
    options.seconds = 2;
    const auto segments = Build(session, options, 0);
    ASSERT_GT(segments.size(), 3u);
    for (std::size_t s = 0; s + 1 < segments.size(); ++s) {
      const auto& keyframes = segments[s].keyframes;
      const std::int64_t begin = keyframes.front().t_ns;
      EXPECT_LT(keyframes.back().t_ns - begin, 2000 * kMs);
      EXPECT_GE(segments[s + 1].keyframes.front().t_ns - begin, 2000 * kMs);
    }
  }
}

TEST(SegmentBuilder, KeepsExactlyTheObservationsOfLandmarksSeenOftenEnough) {
  std::mt19937 random(6);
  for (int trial = 0; trial < 30; ++trial) {
    const Session session = RandomSession(random, 60);
    SegmentBuilderOptions options = Options();
    options.keyframes = 20;
    options.min_observations = 7;
    const auto segments = Build(session, options, 0);
    ASSERT_EQ(segments.size(), 3u);
    for (std::size_t s = 0; s < 3; ++s) {
      std::map<std::uint64_t, int> seen;
      std::map<std::uint64_t, Eigen::Vector3d> last;
      for (std::size_t k = 20 * s; k < 20 * s + 20; ++k) {
        for (const auto& observation : session.observations[k]) {
          ++seen[observation.landmark_id];
          last[observation.landmark_id] = observation.p_G;
        }
      }
      std::map<std::uint64_t, int> kept;
      for (const Observation& observation : segments[s].observations) {
        const auto& landmark =
            segments[s]
                .landmarks[static_cast<std::size_t>(observation.landmark)];
        ++kept[landmark.id];
        EXPECT_EQ(landmark.p_G, last[landmark.id]);
      }
      std::erase_if(seen, [](const auto& entry) { return entry.second < 7; });
      EXPECT_EQ(kept, seen);
      EXPECT_EQ(segments[s].landmarks.size(), seen.size());
    }
  }
}

// Keyframes at 0, 100, 200 ms ... and an IMU sample on each of them and in the
// middle between two.
class RegularStream : public ::testing::Test {
 protected:
  void AddImuUntil(std::int64_t ms) {
    for (; imu_ms_ <= ms; imu_ms_ += 50) builder_.AddImu({imu_ms_ * kMs});
  }
  bool AddKeyframe(std::int64_t ms,
                   const std::vector<KeyframeObservation>& observations = {}) {
    KeyframeState state;
    state.t_ns = ms * kMs;
    return builder_.AddKeyframe(state, observations);
  }

  static SegmentBuilderOptions FiveKeyframes() {
    SegmentBuilderOptions options = Options();
    options.keyframes = 5;
    options.min_observations = 1;
    options.min_keyframes = 3;
    return options;
  }

  SegmentBuilder builder_{FiveKeyframes()};
  std::int64_t imu_ms_ = 0;
};

TEST_F(RegularStream, WaitsForTheSampleThatReachesTheNextSegment) {
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(AddKeyframe(100 * k));
  ASSERT_TRUE(AddKeyframe(600));
  AddImuUntil(550);
  EXPECT_FALSE(builder_.Take().has_value());
  AddImuUntil(600);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.size(), 5u);
  EXPECT_EQ(segment->imu.back().t_ns, 600 * kMs);
  EXPECT_FALSE(builder_.Take().has_value());
}

// No motion about a keyframe is extrapolated: samples before the first one and
// after the last one belong to the segment.
TEST_F(RegularStream, WaitsForThePaddingAfterTheLastKeyframe) {
  for (int k = 10; k < 16; ++k) ASSERT_TRUE(AddKeyframe(100 * k));
  AddImuUntil(1500);
  EXPECT_FALSE(builder_.Take().has_value()) << "0.15 s after 1400 ms";
  AddImuUntil(1550);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.size(), 5u);
  EXPECT_EQ(segment->imu.front().t_ns, 850 * kMs);
  EXPECT_EQ(segment->imu.back().t_ns, 1550 * kMs);
  for (int k = 16; k < 21; ++k) ASSERT_TRUE(AddKeyframe(100 * k));
  AddImuUntil(3000);
  const auto next = builder_.Take();
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(next->key.index, 1);
  EXPECT_EQ(next->imu.front().t_ns, 1350 * kMs) << "overlaps";
  EXPECT_FALSE(builder_.Take().has_value());
}

TEST_F(RegularStream, RefusesAndCountsWhatIsOutOfOrder) {
  AddImuUntil(1000);
  ASSERT_TRUE(AddKeyframe(100));
  EXPECT_FALSE(AddKeyframe(100));
  EXPECT_FALSE(AddKeyframe(0));
  EXPECT_FALSE(builder_.AddImu({1000 * kMs}));
  EXPECT_FALSE(builder_.AddImu({0}));
  for (int k = 2; k < 7; ++k) ASSERT_TRUE(AddKeyframe(100 * k));
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.front().t_ns, 100 * kMs);
  EXPECT_EQ(builder_.statistics().keyframes_refused, 2u);
  EXPECT_EQ(builder_.statistics().imu_ignored, 2u);
  builder_.Flush(2);
  EXPECT_FALSE(AddKeyframe(600)) << "the order holds over a flush, too";
}

TEST_F(RegularStream, KeepsTheFirstOfTwoObservationsByOneCamera) {
  AddImuUntil(1000);
  AddKeyframe(0,
              {{0, 7, {1, 1}, {1, 1, 1}},
               {0, 7, {2, 2}, {2, 2, 2}},
               {1, 7, {3, 3}, {3, 3, 3}}});
  for (int k = 1; k < 6; ++k) AddKeyframe(100 * k);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  ASSERT_EQ(segment->observations.size(), 2u);
  EXPECT_EQ(segment->observations[0].z_px, Eigen::Vector2d(1, 1));
  EXPECT_EQ(segment->observations[1].camera, 1);
  ASSERT_EQ(segment->landmarks.size(), 1u);
  EXPECT_EQ(segment->landmarks[0].p_G, Eigen::Vector3d(3, 3, 3));
}

TEST_F(RegularStream, GivesEachSegmentTheTemperatureThatIsKnown) {
  AddImuUntil(2000);
  for (int k = 0; k < 6; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->temperature_c, std::nullopt);
  EXPECT_TRUE(builder_.SetTemperature(-12.5));
  for (int k = 6; k < 16; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->temperature_c, -12.5);
  EXPECT_EQ(builder_.Take()->temperature_c, -12.5) << "until another is given";
  EXPECT_TRUE(builder_.SetTemperature(std::nullopt));
  for (int k = 16; k < 21; ++k) AddKeyframe(100 * k);
  AddImuUntil(2100);
  EXPECT_EQ(builder_.Take()->temperature_c, std::nullopt);
}

TEST_F(RegularStream, StatesWhereTheSessionBegan) {
  AddImuUntil(2000);
  for (int k = 1; k < 13; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->session_start_ns, 100'000'000);
  EXPECT_EQ(builder_.Take()->session_start_ns, 100'000'000);
}

TEST_F(RegularStream, IgnoresATemperatureThatTheDaemonWouldNotAccept) {
  EXPECT_TRUE(builder_.SetTemperature(36.6));
  for (const double c : {293.15,
                         -100.1,
                         std::numeric_limits<double>::infinity(),
                         std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(builder_.SetTemperature(c)) << c;
  }
  AddImuUntil(1000);
  for (int k = 0; k < 6; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->temperature_c, 36.6);
}

TEST_F(RegularStream, FlushesTheRestIfItIsLongEnough) {
  AddImuUntil(1000);
  for (int k = 0; k < 8; ++k) AddKeyframe(100 * k);
  builder_.Flush(3);
  EXPECT_EQ(builder_.Take()->keyframes.size(), 5u);
  const auto rest = builder_.Take();
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->key.index, 1);
  EXPECT_EQ(rest->keyframes.size(), 3u);
  EXPECT_EQ(rest->imu.back().t_ns, 850 * kMs);

  for (int k = 8; k < 10; ++k) AddKeyframe(100 * k);
  builder_.Flush(3);
  EXPECT_FALSE(builder_.Take().has_value());
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 2u);
  EXPECT_EQ(builder_.next_index(), 2) << "no index is left out";
  builder_.Flush(0);
  EXPECT_FALSE(builder_.Take().has_value()) << "nothing is not a segment";
}

// Samples up to the next keyframe would join a segment with what comes after
// the loss of tracking.
TEST_F(RegularStream, LeavesOutAnIndexIfTrackingWasLostBeforeTheNextKeyframe) {
  AddImuUntil(3000);
  for (int k = 0; k < 4; ++k) AddKeyframe(100 * k);
  builder_.Flush(3);
  const auto before = builder_.Take();
  ASSERT_TRUE(before.has_value());
  EXPECT_EQ(before->imu.back().t_ns, 450 * kMs);
  for (int k = 4; k < 10; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->key.index, 2) << "400 ms is within its samples";
  builder_.Flush(0);
  for (int k = 12; k < 18; ++k) AddKeyframe(100 * k);
  EXPECT_EQ(builder_.Take()->key.index, 3) << "1200 ms is beyond 950 ms";
}

TEST_F(RegularStream, FlushLeavesOutKeyframesThatNoSampleCovers) {
  AddImuUntil(350);
  for (int k = 0; k < 5; ++k) AddKeyframe(100 * k);
  builder_.Flush(2);
  const auto rest = builder_.Take();
  ASSERT_TRUE(rest.has_value());
  EXPECT_EQ(rest->keyframes.back().t_ns, 300 * kMs);
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 1u);
}

TEST_F(RegularStream, DropsKeyframesBeforeTheFirstSample) {
  imu_ms_ = 250;
  for (int k = 0; k < 4; ++k) AddKeyframe(100 * k);
  AddImuUntil(2000);
  for (int k = 4; k < 9; ++k) AddKeyframe(100 * k);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.front().t_ns, 300 * kMs);
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 3u);
}

TEST_F(RegularStream, EndsASegmentAtAGapBetweenKeyframes) {
  AddImuUntil(40'000);
  for (int k = 0; k < 4; ++k) AddKeyframe(30'000 + 100 * k);
  EXPECT_FALSE(builder_.Take().has_value());
  AddImuUntil(60'000);
  const auto rest = builder_.Take();
  ASSERT_TRUE(rest.has_value()) << "nothing can continue it any more";
  EXPECT_EQ(rest->keyframes.size(), 4u);
  for (int k = 0; k < 4; ++k) AddKeyframe(58'000 + 100 * k);
  AddKeyframe(68'400);
  const auto next = builder_.Take();
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(next->keyframes.size(), 4u);
  EXPECT_EQ(next->imu.front().t_ns, 57'850 * kMs);
}

TEST_F(RegularStream, ASwitchOfTheVersionEndsTheSegmentAndLosesNothing) {
  AddImuUntil(350);  // the IMU lags behind
  for (int k = 0; k < 3; ++k) AddKeyframe(100 * k);
  builder_.SetCalibrationVersion(2);
  EXPECT_FALSE(builder_.Take().has_value()) << "its end has not arrived";
  for (int k = 3; k < 9; ++k) AddKeyframe(100 * k);
  AddImuUntil(1000);
  const auto before = builder_.Take();
  ASSERT_TRUE(before.has_value());
  EXPECT_EQ(before->calibration_version, 1);
  EXPECT_EQ(before->key.index, 0);
  EXPECT_EQ(before->keyframes.size(), 3u);
  EXPECT_EQ(before->imu.back().t_ns, 350 * kMs) << "joined with the next";
  const auto after = builder_.Take();
  ASSERT_TRUE(after.has_value());
  EXPECT_EQ(after->calibration_version, 2);
  EXPECT_EQ(after->key.index, 1);
  EXPECT_EQ(after->keyframes.size(), 5u);
  EXPECT_EQ(after->keyframes.front().t_ns, 300 * kMs);
  builder_.SetCalibrationVersion(2);
  AddKeyframe(900);
  AddKeyframe(1000);
  builder_.Flush(2);
  EXPECT_EQ(builder_.Take()->keyframes.size(), 3u) << "not a switch";
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 0u);
}

TEST_F(RegularStream, AVersionOfASingleKeyframeIsDroppedAndCounted) {
  AddImuUntil(2000);
  AddKeyframe(0);
  builder_.SetCalibrationVersion(2);
  for (int k = 1; k < 7; ++k) AddKeyframe(100 * k);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.front().t_ns, 100 * kMs);
  EXPECT_EQ(segment->key.index, 0);
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 1u);
}

TEST_F(RegularStream, SendsNothingOfAnUnhealthyFilter) {
  AddImuUntil(3000);
  for (int k = 0; k < 9; ++k) AddKeyframe(100 * k);
  builder_.SetHealthy(false);
  builder_.SetHealthy(false);
  EXPECT_EQ(builder_.Take()->keyframes.size(), 5u) << "complete before";
  EXPECT_FALSE(AddKeyframe(900));
  builder_.Flush(2);
  EXPECT_FALSE(builder_.Take().has_value());
  EXPECT_EQ(builder_.statistics().keyframes_unhealthy, 5u);
  builder_.SetHealthy(true);
  for (int k = 15; k < 21; ++k) EXPECT_TRUE(AddKeyframe(100 * k));
  const auto next = builder_.Take();
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(next->key.index, 1);
  EXPECT_EQ(next->keyframes.front().t_ns, 1500 * kMs);
  EXPECT_EQ(next->imu.front().t_ns, 1350 * kMs);
  EXPECT_EQ(builder_.statistics().keyframes_dropped, 0u);
}

TEST_F(RegularStream, ASegmentThatWaitsForItsPaddingOutlivesTheFilter) {
  for (int k = 0; k < 6; ++k) AddKeyframe(100 * k);
  AddImuUntil(500);
  EXPECT_FALSE(builder_.Take().has_value());
  builder_.SetHealthy(false);
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->keyframes.size(), 5u);
  EXPECT_EQ(segment->imu.back().t_ns, 500 * kMs);
}

// Ids of the landmarks of the next segment.
std::set<std::uint64_t> LandmarkIds(SegmentBuilder& builder) {
  std::set<std::uint64_t> ids;
  const auto segment = builder.Take();
  EXPECT_TRUE(segment.has_value());
  if (!segment) return ids;
  for (const Landmark& landmark : segment->landmarks) ids.insert(landmark.id);
  return ids;
}

TEST_F(RegularStream, IdsThatStartAgainAfterABreakAreOtherLandmarks) {
  AddImuUntil(17'000);
  const std::vector<KeyframeObservation> seen = {{0, 1, {5, 5}, {0, 0, 1}},
                                                 {0, 2, {6, 5}, {0, 1, 1}}};
  for (int k = 0; k < 11; ++k) AddKeyframe(100 * k, seen);
  const auto first = LandmarkIds(builder_);
  EXPECT_EQ(first, (std::set<std::uint64_t>{1, 2}));
  EXPECT_EQ(LandmarkIds(builder_), first) << "no break";

  builder_.SetHealthy(false);
  builder_.SetHealthy(true);
  for (int k = 11; k < 17; ++k) AddKeyframe(100 * k, seen);
  const auto second = LandmarkIds(builder_);
  EXPECT_EQ(second.size(), 2u);
  EXPECT_FALSE(second.contains(1) || second.contains(2));

  builder_.Flush(2);
  for (int k = 150; k < 156; ++k) AddKeyframe(100 * k, seen);
  const auto third = LandmarkIds(builder_);
  EXPECT_EQ(third.size(), 2u);
  for (const std::uint64_t id : third) {
    EXPECT_FALSE(first.contains(id) || second.contains(id)) << "a gap of 13 s";
  }
}

TEST_F(RegularStream, KeepsIdsOverAGapForASystemWithAMap) {
  SegmentBuilderOptions options = FiveKeyframes();
  options.new_ids_after_gap = false;
  builder_ = SegmentBuilder(options);
  AddImuUntil(17'000);
  const std::vector<KeyframeObservation> seen = {{0, 1, {5, 5}, {0, 0, 1}}};
  for (int k = 0; k < 6; ++k) AddKeyframe(100 * k, seen);
  for (int k = 150; k < 156; ++k) AddKeyframe(100 * k, seen);
  EXPECT_EQ(LandmarkIds(builder_), LandmarkIds(builder_));
}

TEST_F(RegularStream, DropsAndCountsObservationsOutsideTheImage) {
  ASSERT_TRUE(builder_.SetTheta(TwoCameras()));
  AddImuUntil(1000);
  for (int k = 0; k < 6; ++k) {
    AddKeyframe(100 * k,
                {{0, 1, {5, 5}, {0, 0, 1}}, {1, 2, {-4, 5}, {0, 0, 1}}});
  }
  const auto segment = builder_.Take();
  ASSERT_TRUE(segment.has_value());
  EXPECT_EQ(segment->observations.size(), 5u);
  EXPECT_EQ(segment->landmarks.size(), 1u);
  EXPECT_EQ(builder_.statistics().observations_dropped, 6u);
}

TEST_F(RegularStream, IgnoresAThetaThatIsNotValid) {
  Calibration theta = TwoCameras();
  theta.cameras[1].f.x() = -1;
  EXPECT_FALSE(builder_.SetTheta(theta));
  EXPECT_FALSE(builder_.SetTheta({})) << "no camera";
  SegmentBuilderOptions options = FiveKeyframes();
  options.theta = theta;
  builder_ = SegmentBuilder(options);
  AddImuUntil(1000);
  for (int k = 0; k < 6; ++k) AddKeyframe(100 * k, {{0, 1, {-9, 5}}});
  EXPECT_EQ(builder_.statistics().observations_dropped, 0u);
  EXPECT_TRUE(builder_.Take()->landmarks.empty());
  EXPECT_EQ(builder_.statistics().tracks_dropped, 1u);
}

TEST_F(RegularStream, WaitsForTheSamplesThatMoveAState) {
  for (int k = 0; k < 5; ++k) {
    KeyframeState state;
    state.t_ns = (100 * k + 30) * kMs;
    ASSERT_TRUE(builder_.AddKeyframe(state, 100 * k * kMs, {}));
  }
  AddImuUntil(400);
  builder_.Flush(2);
  const auto covered = builder_.Take();
  ASSERT_TRUE(covered.has_value());
  EXPECT_EQ(covered->keyframes.size(), 4u) << "the state of the fifth is later";
  EXPECT_EQ(covered->keyframes.back().t_ns, 300 * kMs);
  EXPECT_EQ(covered->imu.back().t_ns, 400 * kMs) << "all that there is";
}

TEST_F(RegularStream, SendsTheSamplesFromAStateBeforeItsImageOn) {
  AddImuUntil(3000);
  for (int k = 1; k < 12; ++k) {
    KeyframeState state;
    state.t_ns = (100 * k - 30) * kMs;
    ASSERT_TRUE(builder_.AddKeyframe(state, 100 * k * kMs, {}));
  }
  // Samples begin 150 ms before the states, which are at 70 and 570 ms.
  for (const auto& [keyframe_ms, begin_ms] :
       std::vector<std::pair<std::int64_t, std::int64_t>>{{100, 0},
                                                          {600, 400}}) {
    const auto segment = builder_.Take();
    ASSERT_TRUE(segment.has_value());
    EXPECT_EQ(segment->keyframes.front().t_ns, keyframe_ms * kMs);
    EXPECT_EQ(segment->imu.front().t_ns, begin_ms * kMs);
  }
}

TEST_F(RegularStream, RefusesAStateFarFromItsImage) {
  KeyframeState state;
  state.t_ns = 2000 * kMs;
  EXPECT_FALSE(builder_.AddKeyframe(state, 1000 * kMs, {}));
  EXPECT_FALSE(builder_.AddKeyframe(
      state, std::numeric_limits<std::int64_t>::min(), {}));
  EXPECT_EQ(builder_.statistics().keyframes_refused, 2u);
  EXPECT_TRUE(builder_.AddKeyframe(state, 1600 * kMs, {}));
}

TEST_F(RegularStream, IsBoundedWhenTheImuIsSilent) {
  for (int k = 0; k < 5000; ++k) AddKeyframe(100 * k);
  EXPECT_FALSE(builder_.Take().has_value());
  // What waits is what 20 s can bring.
  EXPECT_GE(builder_.statistics().keyframes_dropped, 4700u);
}

TEST_F(RegularStream, GoesOnWhenTheImuComesBack) {
  AddImuUntil(1000);
  for (int k = 0; k < 500; ++k) AddKeyframe(100 * k);
  const auto covered = builder_.Take();
  ASSERT_TRUE(covered.has_value());
  EXPECT_EQ(covered->keyframes.size(), 5u);
  AddImuUntil(52'000);
  for (int k = 500; k < 520; ++k) AddKeyframe(100 * k);
  builder_.Flush(2);
  std::uint64_t in_segments = covered->keyframes.size();
  while (const auto segment = builder_.Take()) {
    in_segments += segment->keyframes.size();
  }
  EXPECT_EQ(in_segments + builder_.statistics().keyframes_dropped, 520u);
  EXPECT_GE(in_segments, 20u);
}

TEST_F(RegularStream, SurvivesTheEndsOfTime) {
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  const auto highest = std::numeric_limits<std::int64_t>::max();
  SegmentBuilder builder(FiveKeyframes());
  for (const std::int64_t t : {lowest, lowest + 1, highest - 1, highest}) {
    EXPECT_TRUE(builder.AddImu({t}));
    KeyframeState state;
    state.t_ns = t;
    EXPECT_TRUE(builder.AddKeyframe(state, {}));
  }
  builder.Flush(2);
  EXPECT_EQ(builder.statistics().segments, 1u);
  EXPECT_EQ(builder.statistics().keyframes_dropped, 2u);
}

}  // namespace
}  // namespace selfcal::client
