#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "test/core/model/random_values.h"
#include "test/core/model/special_values.h"

namespace selfcal {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::int64_t kMillisecond_ns = 1'000'000;

const Calibration& Theta() {
  static const Calibration theta = RandomValues(1).Theta();
  return theta;
}

// 10 keyframes at 10 Hz from 1 s on, IMU at 200 Hz over them, 50 landmarks,
// each seen by every keyframe in one of three cameras.
MotionSegment ValidSegment() {
  RandomValues random(2);
  MotionSegment segment;
  segment.key = {"session 1", 3};
  for (int k = 0; k < 10; ++k) {
    KeyframeState x;
    x.t_ns = (1000 + 100 * k) * kMillisecond_ns;
    x.q_GI = random.Rotation();
    x.p_GI = random.Vector(3, 10);
    x.v_GI = random.Vector(3, 2);
    x.b_a = random.Vector(3, 0.1);
    x.b_g = random.Vector(3, 0.01);
    segment.keyframes.push_back(x);
  }
  for (int i = 0; i <= 180; ++i) {
    segment.imu.push_back({(1000 + 5 * i) * kMillisecond_ns,
                           random.Vector(3, 2),
                           random.Vector(3, 10)});
  }
  for (int l = 0; l < 50; ++l) {
    segment.landmarks.push_back(
        {static_cast<std::uint64_t>(1000 - l), random.Vector(3, 20)});
    for (int k = 0; k < 10; ++k) {
      Observation o;
      o.keyframe = k;
      o.camera = l % 3;
      o.landmark = l;
      o.z_px = {random.Uniform(0, 640), random.Uniform(0, 480)};
      segment.observations.push_back(o);
    }
  }
  return segment;
}

std::vector<std::string> Fields(const std::vector<Violation>& violations) {
  std::vector<std::string> fields;
  for (const Violation& violation : violations) {
    EXPECT_FALSE(violation.message.empty()) << violation.field;
    fields.push_back(violation.field);
  }
  return fields;
}

struct Corruption {
  std::string field;
  std::string message;  // a part of it
  std::function<void(MotionSegment*)> apply;
};

// In the order of the fields; each can be applied together with the others.
std::vector<Corruption> Corruptions() {
  using S = MotionSegment;
  return {
      {"key.session", "empty", [](S* s) { s->key.session.clear(); }},
      {"key.index", "-1 is negative", [](S* s) { s->key.index = -1; }},
      {"calibration_version",
       "begin with 1",
       [](S* s) { s->calibration_version = 0; }},
      {"temperature_c",
       "send degrees Celsius",
       [](S* s) { s->temperature_c = 293.15; }},
      {"keyframes[1].q_GI",
       "norm is 2; send a unit quaternion",
       [](S* s) { s->keyframes[1].q_GI.coeffs() *= 2; }},
      {"keyframes[2].q_GI",
       "not finite",
       [](S* s) { s->keyframes[2].q_GI.x() = kNan; }},
      {"keyframes[3].t_ns",
       "sort by time",
       [](S* s) { s->keyframes[3].t_ns = s->keyframes[2].t_ns; }},
      {"keyframes[3].p_GI",
       "over the limit",
       [](S* s) { s->keyframes[3].p_GI.y() = 1e7; }},
      {"keyframes[4].v_GI",
       "not finite",
       [](S* s) { s->keyframes[4].v_GI.z() = kInfinity; }},
      {"keyframes[5].b_a",
       "not finite",
       [](S* s) { s->keyframes[5].b_a.x() = kNan; }},
      {"keyframes[5].b_g",
       "over the limit",
       [](S* s) { s->keyframes[5].b_g.x() = -1e300; }},
      {"imu[0].t_ns",
       "after the first keyframe",
       [](S* s) { s->imu.front().t_ns += kMillisecond_ns; }},
      {"imu[5].accel",
       "not finite",
       [](S* s) { s->imu[5].accel.x() = -kInfinity; }},
      {"imu[7].t_ns",
       "sort by time",
       [](S* s) { s->imu[7].t_ns = s->imu[6].t_ns - 1; }},
      {"imu[7].gyro", "over the limit", [](S* s) { s->imu[7].gyro.x() = 2e3; }},
      {"imu[180].t_ns",
       "before the last keyframe",
       [](S* s) { s->imu.back().t_ns -= kMillisecond_ns; }},
      {"landmarks[5].p_G",
       "not finite",
       [](S* s) { s->landmarks[5].p_G.x() = kNan; }},
      {"landmarks[9].id",
       "992 is also the id of landmarks[8]",
       [](S* s) { s->landmarks[9].id = s->landmarks[8].id; }},
      {"observations[12].landmark",
       "577 is not among the 50 landmarks of the segment",
       [](S* s) { s->observations[12].landmark = 577; }},
      {"observations[13].keyframe",
       "-1 is not among the 10 keyframes of the segment",
       [](S* s) { s->observations[13].keyframe = -1; }},
      {"observations[14].camera",
       "3 is not among the 3 cameras of the rig",
       [](S* s) { s->observations[14].camera = 3; }},
      {"observations[15].z_px",
       "not finite",
       [](S* s) { s->observations[15].z_px.y() = kNan; }},
      {"observations[16].z_px",
       "outside the image of 640 x 480 px",
       [](S* s) { s->observations[16].z_px.x() = -1.5; }},
      {"observations[20]",
       "keyframe, camera and landmark of observations[17]",
       [](S* s) {
         s->observations[20].keyframe = s->observations[17].keyframe;
         s->observations[20].camera = s->observations[17].camera;
         s->observations[20].landmark = s->observations[17].landmark;
       }},
  };
}

TEST(ValidateSegment, ValidSegmentHasNoViolation) {
  EXPECT_THAT(Fields(Validate(ValidSegment(), Theta())), IsEmpty());
}

TEST(ValidateSegment, EachCorruptionGivesExactlyItsField) {
  for (const Corruption& corruption : Corruptions()) {
    MotionSegment segment = ValidSegment();
    corruption.apply(&segment);
    const std::vector<Violation> violations = Validate(segment, Theta());
    ASSERT_THAT(Fields(violations), ElementsAre(corruption.field));
    EXPECT_THAT(violations[0].message, HasSubstr(corruption.message));
  }
}

TEST(ValidateSegment, AllCorruptionsTogetherGiveAllFieldsInOrder) {
  MotionSegment segment = ValidSegment();
  std::vector<std::string> expected;
  for (const Corruption& corruption : Corruptions()) {
    corruption.apply(&segment);
    expected.push_back(corruption.field);
  }
  // Coverage is validated after the samples themselves.
  const auto first = std::find(expected.begin(), expected.end(), "imu[0].t_ns");
  const auto last =
      std::find(expected.begin(), expected.end(), "imu[180].t_ns");
  std::rotate(first, first + 1, last);
  EXPECT_THAT(Fields(Validate(segment, Theta())), ElementsAreArray(expected));
}

TEST(ValidateSegment, SubsetsOfCorruptionsGiveTheirFields) {
  RandomValues random(3);
  const std::vector<Corruption> corruptions = Corruptions();
  for (int i = 0; i < 1000; ++i) {
    MotionSegment segment = ValidSegment();
    std::vector<std::string> expected;
    for (const Corruption& corruption : corruptions) {
      if (random.Uniform(0, 1) < 0.8) continue;
      corruption.apply(&segment);
      expected.push_back(corruption.field);
    }
    EXPECT_THAT(Fields(Validate(segment, Theta())),
                testing::UnorderedElementsAreArray(expected));
  }
}

TEST(ValidateSegment, SessionNameIsShortAndPrintable) {
  MotionSegment segment = ValidSegment();
  for (const std::string& session : {std::string(129, 'a'),
                                     std::string("a\nb"),
                                     std::string("a\0b", 3),
                                     std::string("\x80")}) {
    segment.key.session = session;
    EXPECT_THAT(Fields(Validate(segment, Theta())), ElementsAre("key.session"));
  }
  segment.key.session = std::string(128, '~');
  EXPECT_THAT(Validate(segment, Theta()), IsEmpty());
}

TEST(ValidateSegment, TemperatureIsThatOfADeviceOrUnknown) {
  MotionSegment segment = ValidSegment();
  for (const double c : {-100.0, 0.0, 200.0}) {
    segment.temperature_c = c;
    EXPECT_THAT(Validate(segment, Theta()), IsEmpty()) << c;
  }
  for (const double c : {-100.01, 200.01, kNan, kInfinity, -kInfinity}) {
    segment.temperature_c = c;
    EXPECT_THAT(Fields(Validate(segment, Theta())),
                ElementsAre("temperature_c"))
        << c;
  }
  segment.temperature_c.reset();
  EXPECT_THAT(Validate(segment, Theta()), IsEmpty());
}

TEST(ValidateSegment, SlopesNeedATemperatureAtWhichTheyArePossible) {
  MotionSegment segment = ValidSegment();
  segment.temperature_c.reset();
  Calibration theta = Theta();
  theta.imu.s_g_slope = Eigen::Vector3d::Constant(-0.02);
  const auto expect = [&](const char* part) {
    const std::vector<Violation> violations = Validate(segment, theta);
    ASSERT_EQ(violations.size(), 1u) << part;
    EXPECT_EQ(violations[0].field, "temperature_c");
    EXPECT_THAT(violations[0].message, testing::HasSubstr(part));
  };
  expect("is missing");
  segment.temperature_c = 60;
  EXPECT_THAT(Validate(segment, theta), IsEmpty());
  segment.temperature_c = 80;
  expect("imu.s_g must be positive");
  segment.temperature_c = kNan;
  expect("is not the temperature of a device");
}

TEST(ValidateSegment, ClocksThatDriftNeedTheBeginOfTheSession) {
  MotionSegment segment = ValidSegment();
  Calibration theta = Theta();
  const auto expect = [&](const char* part) {
    const std::vector<Violation> violations = Validate(segment, theta);
    ASSERT_EQ(violations.size(), 1u) << part;
    EXPECT_EQ(violations[0].field, "session_start_ns");
    EXPECT_THAT(violations[0].message, testing::HasSubstr(part));
  };
  theta.cameras[0].time_drift = 1e-5;
  expect("is missing");
  const std::int64_t first_ns = segment.keyframes.front().t_ns;
  for (const std::int64_t start_ns : {first_ns, first_ns - 3600'000'000'000}) {
    segment.session_start_ns = start_ns;
    EXPECT_THAT(Validate(segment, theta), IsEmpty()) << start_ns;
  }
  theta.cameras[0].time_offset_s = 0.01;
  theta.cameras[0].time_drift = 2e-4;
  expect("is off by 0.73");
  theta.cameras[0].time_drift.reset();
  segment.session_start_ns = first_ns + 1;
  expect("is later than the first keyframe");
  segment.session_start_ns = first_ns - 31 * 86400'000'000'000;
  expect("before the first keyframe");
  segment.session_start_ns = std::numeric_limits<std::int64_t>::min();
  expect("out of range");
}

TEST(ValidateSegment, ASecondImuNeedsSamplesAndOnlyThatMayHaveThem) {
  Calibration theta = Theta();
  MotionSegment segment = ValidSegment();
  segment.imu1 = segment.imu;
  std::vector<Violation> violations = Validate(segment, theta);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "imu1");
  EXPECT_THAT(violations[0].message, HasSubstr("the rig has no second IMU"));
  theta.imu1.emplace();
  EXPECT_TRUE(Validate(segment, theta).empty());
  segment.imu1[3].accel.y() = kNan;
  segment.imu1.pop_back();
  while (segment.imu1.back().t_ns >= segment.keyframes.back().t_ns) {
    segment.imu1.pop_back();
  }
  EXPECT_THAT(Fields(Validate(segment, theta)),
              ElementsAre("imu1[3].accel",
                          "imu1[" + std::to_string(segment.imu1.size() - 1) +
                              "].t_ns"));
  segment.imu1.clear();
  EXPECT_THAT(Fields(Validate(segment, theta)), ElementsAre("imu1"));
}

TEST(ValidateSegment, GapsAreLimited) {
  MotionSegment segment = ValidSegment();
  SegmentLimits limits;
  limits.max_imu_gap_s = 0.0049;
  limits.max_keyframe_gap_s = 0.099;
  limits.max_violations = 1000;
  EXPECT_THAT(Validate(segment, Theta(), limits), SizeIs(180 + 9));
  limits.max_imu_gap_s = 0.0051;
  limits.max_keyframe_gap_s = 0.101;
  EXPECT_THAT(Validate(segment, Theta(), limits), IsEmpty());
}

TEST(ValidateSegment, SamplesMayReachToTheNextSegmentAndNotFarBeyond) {
  MotionSegment segment = ValidSegment();
  SegmentLimits limits;
  const auto extend_to = [&](double seconds) {
    const std::int64_t end_ns = segment.keyframes.back().t_ns +
                                static_cast<std::int64_t>(seconds * 1e9);
    ImuSample sample = segment.imu.back();
    while (sample.t_ns < end_ns) {
      sample.t_ns += 100 * kMillisecond_ns;
      segment.imu.push_back(sample);
    }
  };
  extend_to(9.9);
  EXPECT_THAT(Validate(segment, Theta()), IsEmpty());
  extend_to(10.1);
  EXPECT_THAT(
      Fields(Validate(segment, Theta())),
      ElementsAre("imu[" + std::to_string(segment.imu.size() - 1) + "].t_ns"));
}

TEST(ValidateSegment, TimesAtTheEndsOfTheirTypeAreRefusedWithoutOverflow) {
  MotionSegment segment = ValidSegment();
  segment.keyframes.front().t_ns = std::numeric_limits<std::int64_t>::min();
  segment.keyframes.back().t_ns = std::numeric_limits<std::int64_t>::max();
  segment.imu.front().t_ns = std::numeric_limits<std::int64_t>::min();
  segment.imu.back().t_ns = std::numeric_limits<std::int64_t>::max();
  EXPECT_THAT(Fields(Validate(segment, Theta())),
              ElementsAre("keyframes[0].t_ns",
                          "keyframes[9].t_ns",
                          "imu[0].t_ns",
                          "imu[180].t_ns"));
}

TEST(ValidateSegment, CountsAreLimitedAndLongListsNotInspected) {
  // Every element of the long lists is wrong.
  MotionSegment segment = ValidSegment();
  for (KeyframeState& x : segment.keyframes) x.p_GI.x() = kNan;
  for (ImuSample& sample : segment.imu) sample.gyro.x() = kNan;
  for (Landmark& landmark : segment.landmarks) landmark.p_G.x() = kNan;
  for (Observation& o : segment.observations) o.z_px.x() = kNan;
  SegmentLimits limits;
  limits.max_keyframes = 9;
  limits.max_imu_samples = 180;
  limits.max_landmarks = 49;
  limits.max_observations = 499;
  EXPECT_THAT(Fields(Validate(segment, Theta(), limits)),
              ElementsAre("keyframes", "imu", "landmarks", "observations"));
}

TEST(ValidateSegment, EmptySegmentNeedsKeyframesAndSamples) {
  MotionSegment segment;
  segment.key.session = "s";
  EXPECT_THAT(Fields(Validate(segment, Theta())),
              ElementsAre("keyframes", "imu"));
}

TEST(ValidateSegment, PixelsMayLieOnTheMargin) {
  MotionSegment segment = ValidSegment();
  segment.observations[0].z_px = {-1, -1};
  segment.observations[1].z_px = {641, 481};
  EXPECT_THAT(Validate(segment, Theta()), IsEmpty());
  segment.observations[0].z_px = {-1, -1.01};
  segment.observations[1].z_px = {641.01, 481};
  EXPECT_THAT(Fields(Validate(segment, Theta())),
              ElementsAre("observations[0].z_px", "observations[1].z_px"));
}

TEST(ValidateSegment, ThirdOfAKindNamesTheFirst) {
  MotionSegment segment = ValidSegment();
  segment.landmarks[30].id = segment.landmarks[4].id;
  segment.landmarks[20].id = segment.landmarks[4].id;
  const std::vector<Violation> violations = Validate(segment, Theta());
  EXPECT_THAT(Fields(violations),
              ElementsAre("landmarks[20].id", "landmarks[30].id"));
  for (const Violation& violation : violations) {
    EXPECT_THAT(violation.message, HasSubstr("landmarks[4]"));
  }
}

TEST(ValidateSegment, LongListsOfViolationsAreTruncatedAndMarked) {
  MotionSegment segment = ValidSegment();
  for (ImuSample& sample : segment.imu) sample.gyro.x() = kNan;
  SegmentLimits limits;
  limits.max_violations = 20;
  const std::vector<Violation> violations = Validate(segment, Theta(), limits);
  ASSERT_THAT(violations, SizeIs(21));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(violations[i].field, "imu[" + std::to_string(i) + "].gyro");
  }
  EXPECT_THAT(violations.back().message, HasSubstr("only the first 20"));
  // Exactly as many as allowed: nothing is truncated.
  limits.max_violations = 181;
  EXPECT_THAT(Validate(segment, Theta(), limits), SizeIs(181));
}

}  // namespace
}  // namespace selfcal
