// No exception leaves the C interface, whichever of its allocations fails: a
// program by itself, since it replaces the global operator new.
#include <gtest/gtest.h>

#include <cstdint>

#include "client/c/selfcal.h"
#include "test/client/c/session.h"
#include "test/support/failing_new.h"

namespace selfcal::testing_c {
namespace {

void Feed(const Session& session, selfcal_builder* builder) {
  selfcal_error error;
  for (const selfcal_imu_sample& sample : session.imu) {
    selfcal_builder_add_imu(builder, &sample, &error);
  }
  for (const Keyframe& keyframe : session.keyframes) {
    selfcal_builder_add_keyframe(builder,
                                 &keyframe.state,
                                 keyframe.observations.data(),
                                 keyframe.observations.size(),
                                 &error);
  }
}

TEST(NoMemoryInC, EachFailureIsAnError) {
  const Session session = MakeSession(9);
  selfcal_builder_options walk = {};
  walk.struct_size = sizeof(walk);
  walk.session = "a session with a name that is not a short string";
  walk.keyframes = 4;
  selfcal_client_options device = {};
  device.struct_size = sizeof(device);
  device.target = "unix:/nonexistent/selfcal-no-memory-test.sock";
  device.rig = "a rig with a name that is not a short string";
  device.min_backoff_ms = 1;
  int failures = 0;
  int not_created = 0;
  for (int allocation = 0;; ++allocation) {
    ASSERT_LT(allocation, 10'000);
    selfcal_builder* builder = nullptr;
    selfcal_stream* stream = nullptr;
    selfcal_watch* watch = nullptr;
    selfcal_error error = {};
    std::int32_t created = SELFCAL_OK;
    const auto note = [&](std::int32_t code) {
      if (code != SELFCAL_OK) created = code;
    };
    const bool failed = Fails(allocation, [&] {
      note(selfcal_builder_create(&walk, &builder, &error));
      note(selfcal_stream_create(&device, nullptr, nullptr, &stream, &error));
      note(selfcal_watch_create(&device, nullptr, nullptr, &watch, &error));
      Feed(session, builder);
      while (selfcal_segment* segment = selfcal_builder_take(builder)) {
        selfcal_stream_send(stream, segment, &error);
      }
      selfcal_stream_drain(stream, 1, &error);
      selfcal_stream_connection_status(stream, &error);
      selfcal_watch_connection_status(watch, &error);
    });
    selfcal_builder_destroy(builder);
    selfcal_stream_destroy(stream);
    selfcal_watch_destroy(watch);
    if (!failed) break;
    ++failures;
    if (created != SELFCAL_OK) {
      EXPECT_EQ(created, SELFCAL_RESOURCE_EXHAUSTED) << allocation;
      ++not_created;
    }
  }
  EXPECT_GT(failures, 20);
  EXPECT_GT(not_created, 10);
}

}  // namespace
}  // namespace selfcal::testing_c
