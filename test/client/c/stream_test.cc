// A stream of the C interface: acknowledgements, statistics, states.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "client/c/selfcal.h"
#include "test/client/c/session.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::testing_c {
namespace {

struct Verdicts {
  std::vector<std::int32_t> verdicts;
  std::vector<std::string> violations;
  std::vector<std::string> sessions;
};

void Note(const selfcal_acknowledgement* ack, void* user) {
  auto* const noted = static_cast<Verdicts*>(user);
  EXPECT_EQ(ack->struct_size, sizeof(selfcal_acknowledgement));
  noted->verdicts.push_back(ack->verdict);
  noted->sessions.emplace_back(ack->session);
  for (std::uint64_t i = 0; i < ack->violation_count; ++i) {
    noted->violations.emplace_back(ack->violations[i].field);
  }
}

class StreamTest : public ::testing::Test {
 protected:
  ~StreamTest() override {
    selfcal_stream_destroy(stream_);
    selfcal_builder_destroy(builder_);
  }

  void Create(selfcal_ack_callback on_ack, void* user) {
    const std::string target = daemon_.target();
    const std::string spool = folder_.File("spool");
    selfcal_client_options options = {};
    options.struct_size = sizeof(options);
    options.target = target.c_str();
    options.rig = "device";
    options.min_backoff_ms = 1;
    options.max_backoff_ms = 20;
    options.max_queue = max_queue_;
    if (with_spool_) options.spool_dir = spool.c_str();
    ASSERT_EQ(selfcal_stream_create(&options, on_ack, user, &stream_, nullptr),
              SELFCAL_OK);
    selfcal_builder_options walk = {};
    walk.struct_size = sizeof(walk);
    walk.session = "walk";
    walk.keyframes = 4;
    ASSERT_EQ(selfcal_builder_create(&walk, &builder_, nullptr), SELFCAL_OK);
  }

  // Returns the codes of the sends.
  std::vector<std::int32_t> Send(int segments) {
    const Session session = MakeSession(4 * segments + 1);
    for (const selfcal_imu_sample& sample : session.imu) {
      selfcal_builder_add_imu(builder_, &sample, nullptr);
    }
    std::vector<std::int32_t> codes;
    for (const Keyframe& keyframe : session.keyframes) {
      selfcal_builder_add_keyframe(
          builder_, &keyframe.state, nullptr, 0, nullptr);
      while (selfcal_segment* segment = selfcal_builder_take(builder_)) {
        codes.push_back(selfcal_stream_send(stream_, segment, &error_));
      }
    }
    return codes;
  }

  selfcal_stream_statistics Statistics() const {
    selfcal_stream_statistics statistics = {};
    statistics.struct_size = sizeof(statistics);
    EXPECT_EQ(selfcal_stream_get_statistics(stream_, &statistics, nullptr),
              SELFCAL_OK);
    return statistics;
  }

  std::int32_t max_queue_ = 2;
  bool with_spool_ = false;
  TempFolder folder_;
  client::FakeDaemon daemon_;
  selfcal_stream* stream_ = nullptr;
  selfcal_builder* builder_ = nullptr;
  selfcal_error error_ = {};
};

TEST_F(StreamTest, ReportsEachVerdictWithItsReasons) {
  daemon_.Start();
  daemon_.Reject({"walk", 1});
  Verdicts noted;
  Create(&Note, &noted);
  EXPECT_THAT(Send(2), testing::ElementsAre(SELFCAL_OK, SELFCAL_OK));
  ASSERT_EQ(selfcal_stream_drain(stream_, 60'000, &error_), SELFCAL_OK)
      << error_.message;
  EXPECT_THAT(noted.verdicts,
              testing::ElementsAre(SELFCAL_STORED, SELFCAL_REJECTED));
  EXPECT_THAT(noted.sessions, testing::Each("walk"));
  EXPECT_FALSE(noted.violations.empty());
  EXPECT_EQ(Statistics().queued, 2u);
  EXPECT_EQ(Statistics().stored, 1u);
  EXPECT_EQ(Statistics().rejected, 1u);
  EXPECT_EQ(selfcal_stream_connection_status(stream_, nullptr), SELFCAL_OK);
}

TEST_F(StreamTest, CountsWhatDoesNotFit) {
  Create(nullptr, nullptr);  // the daemon does not run
  EXPECT_THAT(
      Send(3),
      testing::ElementsAre(SELFCAL_OK, SELFCAL_OK, SELFCAL_RESOURCE_EXHAUSTED));
  EXPECT_THAT(error_.message, testing::HasSubstr("dropped"));
  EXPECT_EQ(Statistics().dropped, 1u);
  EXPECT_EQ(selfcal_stream_drain(stream_, 1, &error_),
            SELFCAL_DEADLINE_EXCEEDED);
  EXPECT_THAT(error_.message, testing::HasSubstr("not acknowledged"));
  EXPECT_TRUE(Eventually([&] {
    return selfcal_stream_connection_status(stream_, &error_) ==
           SELFCAL_UNAVAILABLE;
  }));
  EXPECT_STRNE(error_.message, "");
}

TEST_F(StreamTest, SendsWhatAnEarlierStreamLeftInTheSpool) {
  with_spool_ = true;
  max_queue_ = 8;            // holds both, however slow the disk is
  Create(nullptr, nullptr);  // the daemon does not run
  EXPECT_THAT(Send(2), testing::Each(SELFCAL_OK));
  selfcal_stream_destroy(stream_);
  selfcal_builder_destroy(builder_);
  Create(nullptr, nullptr);
  ASSERT_TRUE(Eventually([&] { return Statistics().spool_recovered == 2; }));
  EXPECT_GT(Statistics().spool_bytes, 0u);
  EXPECT_EQ(selfcal_stream_spool_status(stream_, &error_), SELFCAL_OK)
      << error_.message;
  daemon_.Start();
  ASSERT_EQ(selfcal_stream_drain(stream_, 60'000, &error_), SELFCAL_OK)
      << error_.message;
  EXPECT_EQ(Statistics().stored, 2u);
  EXPECT_EQ(Statistics().spool_segments, 0u);
}

TEST_F(StreamTest, EndsWithTheErrorOfTheDaemon) {
  daemon_.Start();
  daemon_.FailStreamsWith({grpc::StatusCode::NOT_FOUND, "no such rig"});
  Create(nullptr, nullptr);
  Send(1);
  EXPECT_EQ(selfcal_stream_drain(stream_, 60'000, &error_), SELFCAL_NOT_FOUND);
  EXPECT_STREQ(error_.message, "no such rig");
}

TEST_F(StreamTest, CatchesWhatACallbackThrows) {
  daemon_.Start();
  Create([](const selfcal_acknowledgement*,
            void*) { throw std::runtime_error("a bug"); },
         nullptr);
  Send(2);
  EXPECT_EQ(selfcal_stream_drain(stream_, 60'000, nullptr), SELFCAL_OK);
  EXPECT_EQ(Statistics().callback_failures, 2u);
}

}  // namespace
}  // namespace selfcal::testing_c
