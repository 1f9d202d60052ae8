#include "proto/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/model/temperature.h"
#include "test/proto/random_values.h"

namespace selfcal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kTrials = 500;

// Equal to the bit: a zero differs from a negative zero.
template <typename Vector>
bool SameBits(const Vector& a, const Vector& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}
bool SameBits(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return SameBits(a.coeffs(), b.coeffs());
}
bool SameBits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

void ExpectSame(const ImuCalibration& a, const ImuCalibration& b) {
  EXPECT_TRUE(SameBits(a.s_g, b.s_g));
  EXPECT_TRUE(SameBits(a.m_g, b.m_g));
  EXPECT_TRUE(SameBits(a.s_a, b.s_a));
  EXPECT_TRUE(SameBits(a.m_a, b.m_a));
  EXPECT_TRUE(SameBits(a.q_AI, b.q_AI));
  EXPECT_TRUE(SameBits(a.gyro_g_sensitivity, b.gyro_g_sensitivity));
  EXPECT_TRUE(SameBits(a.accel_position, b.accel_position));
  for (const auto slope : {&ImuCalibration::s_g_slope,
                           &ImuCalibration::m_g_slope,
                           &ImuCalibration::s_a_slope,
                           &ImuCalibration::m_a_slope,
                           &ImuCalibration::q_AI_slope}) {
    EXPECT_TRUE(SameBits(a.*slope, b.*slope));
  }
}

void ExpectSame(const Calibration& a, const Calibration& b) {
  ExpectSame(a.imu, b.imu);
  ASSERT_EQ(a.imu1.has_value(), b.imu1.has_value());
  if (a.imu1) {
    ExpectSame(static_cast<const ImuCalibration&>(*a.imu1),
               static_cast<const ImuCalibration&>(*b.imu1));
    EXPECT_TRUE(SameBits(a.imu1->q_JI, b.imu1->q_JI));
    EXPECT_TRUE(SameBits(a.imu1->p_JI, b.imu1->p_JI));
    EXPECT_TRUE(SameBits(a.imu1->time_offset_s, b.imu1->time_offset_s));
  }
  if (HasSlopes(a)) {
    EXPECT_TRUE(SameBits(a.reference_temperature_c, b.reference_temperature_c));
  }
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t j = 0; j < a.cameras.size(); ++j) {
    const CameraCalibration& x = a.cameras[j];
    const CameraCalibration& y = b.cameras[j];
    EXPECT_TRUE(SameBits(x.q_CI, y.q_CI));
    EXPECT_TRUE(SameBits(x.p_CI, y.p_CI));
    EXPECT_TRUE(SameBits(x.f, y.f));
    EXPECT_TRUE(SameBits(x.c, y.c));
    EXPECT_EQ(x.model, y.model);
    EXPECT_TRUE(SameBits(x.distortion, y.distortion));
    EXPECT_EQ(x.width_px, y.width_px);
    EXPECT_EQ(x.height_px, y.height_px);
    EXPECT_TRUE(SameBits(x.time_offset_s, y.time_offset_s));
    ASSERT_EQ(x.line_delay_s.has_value(), y.line_delay_s.has_value());
    EXPECT_TRUE(
        SameBits(x.line_delay_s.value_or(0), y.line_delay_s.value_or(0)));
    ASSERT_EQ(x.time_drift.has_value(), y.time_drift.has_value());
    EXPECT_TRUE(SameBits(x.time_drift.value_or(0), y.time_drift.value_or(0)));
    for (const auto slope : {&CameraCalibration::q_CI_slope,
                             &CameraCalibration::p_CI_slope,
                             &CameraCalibration::f_slope,
                             &CameraCalibration::c_slope}) {
      EXPECT_TRUE(SameBits(x.*slope, y.*slope));
    }
  }
}

void ExpectSame(const Rig& a, const Rig& b) {
  EXPECT_EQ(a.id, b.id);
  ExpectSame(a.factory, b.factory);
  ASSERT_EQ(a.prior_mean.has_value(), b.prior_mean.has_value());
  if (a.prior_mean) ExpectSame(*a.prior_mean, *b.prior_mean);
  for (const auto noise : {&ImuNoise::gyro_noise_density,
                           &ImuNoise::accel_noise_density,
                           &ImuNoise::gyro_bias_random_walk,
                           &ImuNoise::accel_bias_random_walk}) {
    EXPECT_TRUE(SameBits(a.imu_noise.*noise, b.imu_noise.*noise));
    EXPECT_TRUE(SameBits(a.imu1_noise.*noise, b.imu1_noise.*noise));
  }
  EXPECT_TRUE(SameBits(a.pixel_sigma_px, b.pixel_sigma_px));
  EXPECT_TRUE(SameBits(a.gravity_mps2, b.gravity_mps2));
  ASSERT_EQ(a.groups.size(), b.groups.size());
  for (std::size_t i = 0; i < a.groups.size(); ++i) {
    EXPECT_EQ(a.groups[i].name, b.groups[i].name);
    EXPECT_EQ(a.groups[i].patterns, b.groups[i].patterns);
  }
  ASSERT_EQ(a.prior_sigmas.size(), b.prior_sigmas.size());
  for (std::size_t i = 0; i < a.prior_sigmas.size(); ++i) {
    EXPECT_EQ(a.prior_sigmas[i].pattern, b.prior_sigmas[i].pattern);
    EXPECT_TRUE(SameBits(a.prior_sigmas[i].value, b.prior_sigmas[i].value));
  }
  EXPECT_EQ(a.fixed, b.fixed);
  EXPECT_EQ(a.selection, b.selection);
  EXPECT_EQ(a.table_size, b.table_size);
  EXPECT_TRUE(SameBits(a.min_gain_nats, b.min_gain_nats));
  EXPECT_TRUE(SameBits(a.retrigger_fraction, b.retrigger_fraction));
  EXPECT_EQ(a.blocks, b.blocks);
  EXPECT_EQ(a.reweight_noise, b.reweight_noise);
  EXPECT_EQ(a.imu_full_scale.gyro_radps, b.imu_full_scale.gyro_radps);
  EXPECT_EQ(a.imu_full_scale.accel_mps2, b.imu_full_scale.accel_mps2);
  EXPECT_EQ(a.imu1_full_scale.gyro_radps, b.imu1_full_scale.gyro_radps);
  EXPECT_EQ(a.imu1_full_scale.accel_mps2, b.imu1_full_scale.accel_mps2);
}

void ExpectSame(const MotionSegment& a, const MotionSegment& b) {
  EXPECT_EQ(a.key, b.key);
  EXPECT_EQ(a.calibration_version, b.calibration_version);
  EXPECT_EQ(a.temperature_c, b.temperature_c);
  EXPECT_EQ(a.session_start_ns, b.session_start_ns);
  ASSERT_EQ(a.keyframes.size(), b.keyframes.size());
  for (std::size_t k = 0; k < a.keyframes.size(); ++k) {
    const KeyframeState& x = a.keyframes[k];
    const KeyframeState& y = b.keyframes[k];
    EXPECT_EQ(x.t_ns, y.t_ns);
    EXPECT_TRUE(SameBits(x.q_GI, y.q_GI));
    EXPECT_TRUE(SameBits(x.p_GI, y.p_GI));
    EXPECT_TRUE(SameBits(x.v_GI, y.v_GI));
    EXPECT_TRUE(SameBits(x.b_a, y.b_a));
    EXPECT_TRUE(SameBits(x.b_g, y.b_g));
  }
  for (const auto samples : {&MotionSegment::imu, &MotionSegment::imu1}) {
    const std::vector<ImuSample>& x = a.*samples;
    const std::vector<ImuSample>& y = b.*samples;
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t k = 0; k < x.size(); ++k) {
      EXPECT_EQ(x[k].t_ns, y[k].t_ns);
      EXPECT_TRUE(SameBits(x[k].gyro, y[k].gyro));
      EXPECT_TRUE(SameBits(x[k].accel, y[k].accel));
    }
  }
  ASSERT_EQ(a.landmarks.size(), b.landmarks.size());
  for (std::size_t k = 0; k < a.landmarks.size(); ++k) {
    EXPECT_EQ(a.landmarks[k].id, b.landmarks[k].id);
    EXPECT_TRUE(SameBits(a.landmarks[k].p_G, b.landmarks[k].p_G));
  }
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (std::size_t k = 0; k < a.observations.size(); ++k) {
    const Observation& x = a.observations[k];
    const Observation& y = b.observations[k];
    EXPECT_EQ(x.keyframe, y.keyframe);
    EXPECT_EQ(x.camera, y.camera);
    EXPECT_EQ(x.landmark, y.landmark);
    EXPECT_TRUE(SameBits(x.z_px, y.z_px));
  }
}

// Over the wire and back.
template <typename Value>
void ExpectRoundTrip(const Value& value) {
  auto sent = ToProto(value);
  decltype(sent) received;
  ASSERT_TRUE(received.ParseFromString(sent.SerializeAsString()));
  Value back;
  ASSERT_THAT(FromProto(received, "", &back), IsEmpty());
  ExpectSame(value, back);
}

template <typename Message, typename Value>
std::vector<std::string> FaultyFields(const Message& message, Value value) {
  std::vector<std::string> fields;
  for (const Violation& violation : FromProto(message, "x.", &value)) {
    EXPECT_FALSE(violation.message.empty());
    fields.push_back(violation.field);
  }
  return fields;
}

TEST(Convert, CalibrationKeepsEveryBitOverTheWire) {
  RandomValues random(1);
  for (int i = 0; i < kTrials; ++i) ExpectRoundTrip(random.Theta());
}

TEST(Convert, RigKeepsEveryBitOverTheWire) {
  RandomValues random(2);
  for (int i = 0; i < kTrials; ++i) ExpectRoundTrip(random.RigValue());
}

TEST(Convert, SegmentKeepsEveryBitOverTheWire) {
  RandomValues random(3);
  for (int i = 0; i < kTrials; ++i) ExpectRoundTrip(random.Segment());
}

TEST(Convert, NotANumberSurvivesSoThatValidationCanNameIt) {
  MotionSegment segment;
  segment.landmarks = {
      {1, Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())}};
  MotionSegment back;
  ASSERT_THAT(FromProto(ToProto(segment), "", &back), IsEmpty());
  EXPECT_TRUE(back.landmarks[0].p_G.array().isNaN().all());
}

TEST(Convert, EveryColumnOfTheWrongLengthIsNamed) {
  v1::MotionSegment message;
  message.mutable_keyframes()->add_t_ns(1);
  message.mutable_keyframes()->add_b_g(1);
  message.mutable_imu()->add_gyro(1);
  message.mutable_landmarks()->add_id(1);
  message.mutable_observations()->add_z_px(1);
  EXPECT_THAT(FaultyFields(message, MotionSegment()),
              ElementsAre("x.keyframes.q_gi",
                          "x.keyframes.p_gi",
                          "x.keyframes.v_gi",
                          "x.keyframes.b_a",
                          "x.keyframes.b_g",
                          "x.imu.gyro",
                          "x.landmarks.p_g",
                          "x.observations.z_px"));
}

TEST(Convert, OneColumnCutShortAnywhereIsRefused) {
  RandomValues random(4);
  for (int i = 0; i < kTrials; ++i) {
    MotionSegment segment = random.Segment();
    if (segment.keyframes.empty() || segment.observations.empty()) continue;
    v1::MotionSegment message = ToProto(segment);
    message.mutable_keyframes()->mutable_v_gi()->RemoveLast();
    message.mutable_observations()->mutable_camera()->RemoveLast();
    EXPECT_THAT(FaultyFields(message, MotionSegment()),
                ElementsAre("x.keyframes.v_gi", "x.observations.camera"));
  }
}

TEST(Convert, SegmentWithoutMomentsOrSamplesIsRefused) {
  EXPECT_THAT(FaultyFields(v1::MotionSegment(), MotionSegment()),
              ElementsAre("x.keyframes", "x.imu"));
}

TEST(Convert, AbsentCalibrationVersionMeansTheFactorys) {
  v1::MotionSegment message = ToProto(MotionSegment());
  message.clear_calibration_version();
  MotionSegment segment;
  segment.calibration_version = 7;
  ASSERT_THAT(FromProto(message, "", &segment), IsEmpty());
  EXPECT_EQ(segment.calibration_version, 1);
}

TEST(Convert, UnknownDistortionModelIsNamed) {
  RandomValues random(5);
  Calibration theta;
  theta.cameras = {random.Camera(), random.Camera(), random.Camera()};
  v1::CalibrationParameters message = ToProto(theta);
  message.mutable_cameras(1)->set_distortion_model(
      static_cast<v1::DistortionModel>(77));
  message.mutable_cameras(2)->clear_distortion_model();
  EXPECT_THAT(FaultyFields(message, Calibration()),
              ElementsAre("x.cameras[1].distortion_model",
                          "x.cameras[2].distortion_model"));
}

TEST(Convert, WrongNumberOfCoefficientsIsNamed) {
  RandomValues random(6);
  Calibration theta;
  theta.cameras = {random.Camera()};
  v1::CalibrationParameters message = ToProto(theta);
  message.mutable_cameras(0)->add_distortion(0);
  EXPECT_THAT(FaultyFields(message, Calibration()),
              ElementsAre("x.cameras[0].distortion"));
  for (int i = 0; i < 100000; ++i) {
    message.mutable_cameras(0)->add_distortion(0);
  }
  EXPECT_THAT(FaultyFields(message, Calibration()),
              ElementsAre("x.cameras[0].distortion"));
}

TEST(Convert, EveryMissingPartOfACalibrationIsNamed) {
  v1::CalibrationParameters message;
  message.add_cameras()->set_distortion_model(v1::DISTORTION_MODEL_FOV);
  EXPECT_THAT(FaultyFields(message, Calibration()),
              ElementsAre("x.imu",
                          "x.cameras[0].q_ci",
                          "x.cameras[0].p_ci",
                          "x.cameras[0].f",
                          "x.cameras[0].c",
                          "x.cameras[0].distortion"));
  message.Clear();
  message.mutable_imu();
  EXPECT_THAT(
      FaultyFields(message, Calibration()),
      ElementsAre(
          "x.imu.s_g", "x.imu.m_g", "x.imu.s_a", "x.imu.m_a", "x.imu.q_ai"));
}

TEST(Convert, ASecondImuNeedsAPoseAndTheFirstHasNone) {
  v1::CalibrationParameters message = ToProto(Calibration());
  message.mutable_imu()->mutable_q_ji();
  message.mutable_imu()->set_time_offset_s(1e-3);
  *message.mutable_imu1() = ToProto(Calibration()).imu();
  EXPECT_THAT(
      FaultyFields(message, Calibration()),
      ElementsAre(
          "x.imu.q_ji", "x.imu.time_offset_s", "x.imu1.q_ji", "x.imu1.p_ji"));
}

TEST(Convert, OnlyARigWithASecondImuHasItsNoise) {
  Rig rig;
  rig.id = "r";
  v1::Rig message = ToProto(rig);
  message.mutable_imu1_noise();
  message.mutable_imu1();
  EXPECT_THAT(FaultyFields(message, Rig()),
              ElementsAre("x.imu1_noise", "x.imu1"));
  rig.factory.imu1.emplace();
  message = ToProto(rig);
  message.clear_imu1_noise();
  EXPECT_THAT(FaultyFields(message, Rig()), ElementsAre("x.imu1_noise"));
}

TEST(Convert, EveryMissingPartOfARigIsNamed) {
  EXPECT_THAT(FaultyFields(v1::Rig(), Rig()),
              ElementsAre("x.name", "x.factory", "x.imu_noise"));
}

TEST(Convert, UnsetSettingsOfARigTakeTheirDefaults) {
  RandomValues random(7);
  Rig given = random.RigValue();
  given.factory.cameras.resize(1, random.Camera());
  given.factory.cameras[0].line_delay_s.reset();
  given.factory.cameras[0].time_drift.reset();
  given.factory.imu1.reset();
  v1::Rig message = ToProto(given);
  message.clear_gravity_mps2();
  message.clear_groups();
  message.clear_selection();
  message.clear_table_size();
  message.clear_min_gain_nats();
  message.clear_retrigger_fraction();
  message.clear_estimate_time_offset();
  message.clear_blocks();
  Rig rig;
  ASSERT_THAT(FromProto(message, "", &rig), IsEmpty());
  const Rig defaults;
  EXPECT_EQ(rig.gravity_mps2, defaults.gravity_mps2);
  EXPECT_EQ(rig.selection, defaults.selection);
  EXPECT_EQ(rig.table_size, defaults.table_size);
  EXPECT_EQ(rig.min_gain_nats, defaults.min_gain_nats);
  EXPECT_EQ(rig.retrigger_fraction, defaults.retrigger_fraction);
  EXPECT_TRUE(rig.blocks.empty());
  EXPECT_EQ(rig.groups.size(), DefaultGroups().size());
  message.set_estimate_time_offset(true);
  ASSERT_THAT(FromProto(message, "", &rig), IsEmpty());
  ASSERT_EQ(rig.groups.size(), 4u);
  EXPECT_EQ(rig.groups.back().name, "time");
  message.set_min_gain_nats(0);
  ASSERT_THAT(FromProto(message, "", &rig), IsEmpty());
  EXPECT_EQ(rig.min_gain_nats, 0);
}

TEST(Convert, FlagForTimeOffsetsIsABlockThatIsOn) {
  RandomValues random(11);
  Rig rig = random.RigValue();
  rig.factory.cameras.resize(2, random.Camera());
  rig.blocks.clear();
  v1::Rig message = ToProto(rig);
  EXPECT_FALSE(message.estimate_time_offset());
  message.set_estimate_time_offset(true);
  ASSERT_THAT(FromProto(message, "", &rig), IsEmpty());
  EXPECT_EQ(rig.blocks, (std::vector<BlockSetting>{{"*.time_offset", true}}));
  // Both forms are answered, and mean the same when they are sent again.
  message = ToProto(rig);
  EXPECT_TRUE(message.estimate_time_offset());
  ASSERT_EQ(message.blocks_size(), 1);
  ASSERT_THAT(FromProto(message, "", &rig), IsEmpty());
  EXPECT_EQ(rig.blocks.size(), 1u);
  // Of one camera only: there is no flag for that.
  rig.blocks = {{"cam1.time_offset", true}};
  EXPECT_FALSE(ToProto(rig).estimate_time_offset());
}

TEST(Convert, FlagForTimeOffsetsMustNotContradictTheBlocks) {
  RandomValues random(12);
  Rig rig = random.RigValue();
  rig.factory.cameras.resize(2, random.Camera());
  rig.blocks = {{"cam1.time_offset", false}};
  v1::Rig message = ToProto(rig);
  message.set_estimate_time_offset(true);
  const std::vector<Violation> violations = FromProto(message, "x.", &rig);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "x.estimate_time_offset");
  EXPECT_THAT(violations[0].message, testing::HasSubstr("cam1.time_offset"));
}

TEST(Convert, BlockWithoutAStateIsRefused) {
  RandomValues random(13);
  Rig rig = random.RigValue();
  rig.blocks = {{"imu.*", false}, {"imu.gyro.scale", true}};
  v1::Rig message = ToProto(rig);
  message.mutable_blocks(1)->clear_state();
  EXPECT_THAT(FaultyFields(message, Rig()), ElementsAre("x.blocks[1].state"));
}

TEST(Convert, AnUnknownSelectionIsRefused) {
  RandomValues random(9);
  v1::Rig message = ToProto(random.RigValue());
  message.set_selection(static_cast<v1::Rig::Selection>(9));
  Rig rig;
  const auto violations = FromProto(message, "x.", &rig);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0].field, "x.selection");
}

TEST(Convert, ARefusedMessageLeavesTheValueAsItWas) {
  RandomValues random(8);
  const Calibration before = random.Theta();
  Calibration theta = before;
  v1::CalibrationParameters message = ToProto(random.Theta());
  message.clear_imu();
  ASSERT_FALSE(FromProto(message, "", &theta).empty());
  ExpectSame(theta, before);
}

}  // namespace
}  // namespace selfcal
