// Arguments that are null or wrong give an error, and nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "client/c/selfcal.h"
#include "test/client/c/session.h"
#include "test/support/eventually.h"

namespace selfcal::testing_c {
namespace {

using testing::HasSubstr;

selfcal_builder_options Walk() {
  selfcal_builder_options options = {};
  options.struct_size = sizeof(options);
  options.session = "walk";
  return options;
}

selfcal_client_options Device() {
  selfcal_client_options options = {};
  options.struct_size = sizeof(options);
  options.target = "unix:/nonexistent/selfcal-arguments-test.sock";
  options.rig = "device";
  return options;
}

class ArgumentsTest : public ::testing::Test {
 protected:
  ArgumentsTest() {
    const selfcal_builder_options walk = Walk();
    const selfcal_client_options device = Device();
    EXPECT_EQ(selfcal_builder_create(&walk, &builder_, nullptr), SELFCAL_OK);
    EXPECT_EQ(
        selfcal_stream_create(&device, nullptr, nullptr, &stream_, nullptr),
        SELFCAL_OK);
    EXPECT_EQ(selfcal_watch_create(&device, nullptr, nullptr, &watch_, nullptr),
              SELFCAL_OK);
  }
  ~ArgumentsTest() override {
    selfcal_builder_destroy(builder_);
    selfcal_stream_destroy(stream_);
    selfcal_watch_destroy(watch_);
  }

  // The message for options of a builder that are refused.
  std::string Refusal(const selfcal_builder_options& options) {
    selfcal_builder* made = builder_;
    EXPECT_EQ(selfcal_builder_create(&options, &made, &error_),
              SELFCAL_INVALID_ARGUMENT);
    EXPECT_EQ(made, nullptr);
    EXPECT_EQ(error_.code, SELFCAL_INVALID_ARGUMENT);
    return error_.message;
  }
  std::string Refusal(const selfcal_client_options& options) {
    selfcal_stream* made = stream_;
    EXPECT_EQ(selfcal_stream_create(&options, nullptr, nullptr, &made, &error_),
              SELFCAL_INVALID_ARGUMENT);
    EXPECT_EQ(made, nullptr);
    selfcal_watch* watch = watch_;
    EXPECT_EQ(selfcal_watch_create(&options, nullptr, nullptr, &watch, nullptr),
              SELFCAL_INVALID_ARGUMENT);
    EXPECT_EQ(watch, nullptr);
    return error_.message;
  }

  selfcal_builder* builder_ = nullptr;
  selfcal_stream* stream_ = nullptr;
  selfcal_watch* watch_ = nullptr;
  selfcal_error error_ = {};
};

TEST_F(ArgumentsTest, NullIsAnErrorOfEachFunctionThatHasErrors) {
  const selfcal_builder_options walk = Walk();
  const selfcal_client_options device = Device();
  const selfcal_imu_sample sample = {};
  const selfcal_keyframe_state state = {};
  selfcal_builder_statistics counts = {};
  counts.struct_size = sizeof(counts);
  selfcal_stream_statistics sent = {};
  sent.struct_size = sizeof(sent);
  selfcal_imu imu = {};
  selfcal_camera camera = {};
  selfcal_component component = {};
  const selfcal_imu no_size = {};
  selfcal_calibration* calibration = nullptr;
  selfcal_builder* builder = nullptr;
  selfcal_stream* stream = nullptr;
  selfcal_watch* watch = nullptr;
  selfcal_calibration* at = nullptr;
  double v[3] = {0, 0, 0};
  selfcal_error* const e = nullptr;
  const std::vector<std::int32_t> codes = {
      selfcal_builder_create(nullptr, &builder, e),
      selfcal_builder_create(&walk, nullptr, e),
      selfcal_builder_add_imu(nullptr, &sample, e),
      selfcal_builder_add_imu(builder_, nullptr, e),
      selfcal_builder_add_second_imu(nullptr, &sample, e),
      selfcal_builder_add_second_imu(builder_, nullptr, e),
      selfcal_builder_add_keyframe(nullptr, &state, nullptr, 0, e),
      selfcal_builder_add_keyframe(builder_, nullptr, nullptr, 0, e),
      selfcal_builder_add_keyframe(builder_, &state, nullptr, 1, e),
      selfcal_builder_add_keyframe_at(nullptr, &state, 0, nullptr, 0, e),
      selfcal_builder_set_calibration_version(nullptr, 2, e),
      selfcal_builder_set_theta(nullptr, nullptr, e),
      selfcal_builder_set_theta(builder_, nullptr, e),
      selfcal_builder_set_healthy(nullptr, 1, e),
      selfcal_calibration_create(nullptr, nullptr, 0, &calibration, e),
      selfcal_calibration_create(&no_size, nullptr, 0, &calibration, e),
      selfcal_builder_set_temperature(nullptr, 20, e),
      selfcal_builder_clear_temperature(nullptr, e),
      selfcal_builder_flush(nullptr, 10, e),
      selfcal_builder_get_statistics(nullptr, &counts, e),
      selfcal_builder_get_statistics(builder_, nullptr, e),
      selfcal_stream_create(nullptr, nullptr, nullptr, &stream, e),
      selfcal_stream_create(&device, nullptr, nullptr, nullptr, e),
      selfcal_stream_send(nullptr, nullptr, e),
      selfcal_stream_send(stream_, nullptr, e),
      selfcal_stream_drain(nullptr, 0, e),
      selfcal_stream_get_statistics(nullptr, &sent, e),
      selfcal_stream_get_statistics(stream_, nullptr, e),
      selfcal_stream_connection_status(nullptr, e),
      selfcal_stream_spool_status(nullptr, e),
      selfcal_watch_create(nullptr, nullptr, nullptr, &watch, e),
      selfcal_watch_create(&device, nullptr, nullptr, nullptr, e),
      selfcal_watch_connection_status(nullptr, e),
      selfcal_calibration_get_imu(nullptr, &imu, e),
      selfcal_calibration_get_camera(nullptr, 0, &camera, e),
      selfcal_calibration_get_component(nullptr, 0, &component, e),
      selfcal_calibration_get_covariance(nullptr, v, 1, e),
      selfcal_calibration_correct_imu(nullptr, v, v, v, v, v, v, e),
      selfcal_calibration_correct_imu_dw(nullptr, v, v, v, v, v, v, v, e),
      selfcal_calibration_carry_biases(nullptr, nullptr, v, v, v, e),
      selfcal_calibration_at_temperature(nullptr, 0, &at, e),
      selfcal_calibration_with_block(nullptr, "imu.q_AI", v, 4, &at, e),
      selfcal_calibration_project(nullptr, 0, v, v, e),
      selfcal_calibration_unproject(nullptr, 0, v, v, e),
  };
  for (std::size_t i = 0; i < codes.size(); ++i) {
    EXPECT_EQ(codes[i], SELFCAL_INVALID_ARGUMENT) << i;
  }
  EXPECT_EQ(selfcal_builder_add_imu(builder_, nullptr, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_STREQ(error_.message, "sample: is NULL");
}

TEST_F(ArgumentsTest, NullIsAcceptedWhereItIsStated) {
  selfcal_builder_destroy(nullptr);
  selfcal_segment_destroy(nullptr);
  selfcal_stream_destroy(nullptr);
  selfcal_watch_destroy(nullptr);
  selfcal_calibration_destroy(nullptr);
  EXPECT_EQ(selfcal_builder_take(nullptr), nullptr);
  EXPECT_EQ(selfcal_builder_next_index(nullptr), 0);
  EXPECT_EQ(selfcal_segment_index(nullptr), 0);
  EXPECT_EQ(selfcal_calibration_copy(nullptr), nullptr);
  EXPECT_EQ(selfcal_calibration_version(nullptr), 0);
  EXPECT_EQ(selfcal_calibration_camera_count(nullptr), 0);
  EXPECT_EQ(selfcal_calibration_component_count(nullptr), 0);
  EXPECT_EQ(selfcal_watch_newest(nullptr), nullptr);
  EXPECT_EQ(selfcal_watch_newest(watch_), nullptr);  // nothing has come
}

TEST_F(ArgumentsTest, ASizeThatIsNoneOfTheStructIsRefused) {
  selfcal_builder_options options = Walk();
  for (const std::uint32_t size : {0u, 3u, 79u, 0xffffffffu}) {
    options.struct_size = size;
    EXPECT_THAT(Refusal(options), HasSubstr("options: struct_size is "))
        << size;
  }
  selfcal_client_options device = Device();
  device.struct_size = 0;
  EXPECT_THAT(Refusal(device), HasSubstr("struct_size is 0"));
  selfcal_stream_statistics statistics = {};
  EXPECT_EQ(selfcal_stream_get_statistics(stream_, &statistics, &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_THAT(error_.message, HasSubstr("statistics: struct_size is 0"));
}

TEST_F(ArgumentsTest, AStructOfANewerHeaderIsReadAsFarAsItIsKnown) {
  struct {
    selfcal_builder_options options;
    double later;
  } newer = {Walk(), 0};
  newer.options.struct_size = sizeof(newer);
  selfcal_builder* made = nullptr;
  EXPECT_EQ(selfcal_builder_create(&newer.options, &made, nullptr), SELFCAL_OK);
  selfcal_builder_destroy(made);
  newer.later = 1;
  EXPECT_THAT(Refusal(newer.options), HasSubstr("update the library"));
}

TEST_F(ArgumentsTest, AStructOfANewerHeaderIsFilledAsFarAsItIsKnown) {
  struct {
    selfcal_builder_statistics statistics;
    std::uint64_t later;
    std::uint64_t beyond;
  } newer = {};
  newer.statistics.struct_size = sizeof(newer.statistics) + 8;
  newer.later = 5;
  newer.beyond = 5;
  const selfcal_imu_sample sample = {};
  selfcal_builder_add_imu(builder_, &sample, nullptr);
  selfcal_builder_add_imu(builder_, &sample, nullptr);
  ASSERT_EQ(
      selfcal_builder_get_statistics(builder_, &newer.statistics, nullptr),
      SELFCAL_OK);
  EXPECT_EQ(newer.statistics.imu_ignored, 1u);
  EXPECT_EQ(newer.statistics.struct_size, sizeof(newer.statistics) + 8);
  EXPECT_EQ(newer.later, 0u);
  EXPECT_EQ(newer.beyond, 5u);
}

TEST_F(ArgumentsTest, OptionsThatAreWrongAreNamed) {
  selfcal_builder_options walk = Walk();
  walk.session = nullptr;
  EXPECT_EQ(Refusal(walk), "options.session: is required");
  walk = Walk();
  walk.keyframes = -1;
  EXPECT_EQ(Refusal(walk), "options.keyframes: is -1, must be at least 0");
  walk = Walk();
  walk.seconds = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Refusal(walk), HasSubstr("options.seconds"));
  walk = Walk();
  walk.max_gap_s = std::numeric_limits<double>::infinity();
  EXPECT_THAT(Refusal(walk), HasSubstr("options.max_gap_s"));
  selfcal_client_options device = Device();
  device.rig = "";
  EXPECT_EQ(Refusal(device), "options.rig: is required");
  device = Device();
  device.reserved = 1;
  EXPECT_EQ(Refusal(device), "options.reserved: must be 0");
  device = Device();
  device.min_backoff_ms = -1;
  EXPECT_THAT(Refusal(device), HasSubstr("options.min_backoff_ms: is -1"));
}

TEST_F(ArgumentsTest, InputOutOfOrderIsRefusedAndCounted) {
  selfcal_imu_sample sample = {};
  EXPECT_EQ(selfcal_builder_add_imu(builder_, &sample, nullptr), SELFCAL_OK);
  EXPECT_EQ(selfcal_builder_add_imu(builder_, &sample, &error_),
            SELFCAL_OUT_OF_RANGE);
  EXPECT_THAT(error_.message, HasSubstr("not later"));
  // The second IMU has an order of its own.
  EXPECT_EQ(selfcal_builder_add_second_imu(builder_, &sample, nullptr),
            SELFCAL_OK);
  EXPECT_EQ(selfcal_builder_add_second_imu(builder_, &sample, &error_),
            SELFCAL_OUT_OF_RANGE);
  selfcal_keyframe_state state = {};
  EXPECT_EQ(selfcal_builder_add_keyframe(builder_, &state, nullptr, 0, nullptr),
            SELFCAL_OK);
  EXPECT_EQ(selfcal_builder_add_keyframe(builder_, &state, nullptr, 0, &error_),
            SELFCAL_OUT_OF_RANGE);
  EXPECT_EQ(selfcal_builder_set_temperature(builder_, 1000, &error_),
            SELFCAL_OUT_OF_RANGE);
  selfcal_builder_statistics counts = {};
  counts.struct_size = sizeof(counts);
  ASSERT_EQ(selfcal_builder_get_statistics(builder_, &counts, nullptr),
            SELFCAL_OK);
  EXPECT_EQ(counts.imu_ignored, 2u);
  EXPECT_EQ(counts.keyframes_refused, 1u);
}

TEST_F(ArgumentsTest, ObservationsAreCheckedBeforeAnyIsUsed) {
  Session session = MakeSession(1);
  Keyframe& keyframe = session.keyframes[0];
  keyframe.observations[3].reserved = 1;
  EXPECT_EQ(selfcal_builder_add_keyframe(builder_,
                                         &keyframe.state,
                                         keyframe.observations.data(),
                                         keyframe.observations.size(),
                                         &error_),
            SELFCAL_INVALID_ARGUMENT);
  EXPECT_STREQ(error_.message, "observations[3].reserved: must be 0");
  EXPECT_EQ(
      selfcal_builder_add_keyframe(builder_,
                                   &keyframe.state,
                                   keyframe.observations.data(),
                                   std::numeric_limits<std::uint64_t>::max(),
                                   &error_),
      SELFCAL_INVALID_ARGUMENT);
  EXPECT_THAT(error_.message, HasSubstr("count: is 18446744073709551615"));
  // The time of a keyframe that was refused is still free.
  EXPECT_EQ(selfcal_builder_add_keyframe(
                builder_, &keyframe.state, nullptr, 0, nullptr),
            SELFCAL_OK);
}

TEST_F(ArgumentsTest, ALongMessageIsCutBetweenCharacters) {
  std::string folder = "/proc/nonexistent/";
  for (int i = 0; i < 400; ++i) folder += "\u00e4";  // of two bytes
  selfcal_client_options device = Device();
  device.ca_file = folder.c_str();
  selfcal_watch* watch = nullptr;
  ASSERT_EQ(selfcal_watch_create(&device, nullptr, nullptr, &watch, nullptr),
            SELFCAL_OK);
  const bool has_failed = Eventually([&] {
    return selfcal_watch_connection_status(watch, &error_) != SELFCAL_OK;
  });
  selfcal_watch_destroy(watch);
  ASSERT_TRUE(has_failed);
  const std::string message = error_.message;
  EXPECT_EQ(error_.code, SELFCAL_FAILED_PRECONDITION);
  EXPECT_GE(message.size(), sizeof(error_.message) - 2);
  const std::string start = "cannot read /proc/nonexistent/";
  EXPECT_EQ(message.substr(0, start.size()), start);
  EXPECT_EQ((message.size() - start.size()) % 2, 0u);
}

TEST(Version, IsThatOfTheLibrary) {
  EXPECT_THAT(selfcal_version(), testing::MatchesRegex("[0-9.]+"));
}

}  // namespace
}  // namespace selfcal::testing_c
