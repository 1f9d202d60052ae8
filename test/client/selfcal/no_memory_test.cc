// No function of the client throws, whichever of its allocations fails: a
// program by itself, since it replaces the global operator new.
#include <gtest/gtest.h>

#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"
#include "test/support/failing_new.h"

namespace selfcal::client {
namespace {

// 30 keyframes, 6 to a segment, with ten samples and three landmarks each. The
// samples after one keyframe suffice to close its segment.
void Feed(const std::vector<KeyframeObservation>& seen,
          SegmentBuilder* builder) {
  constexpr std::int64_t kStep_ns = 400'000'000;
  for (std::int64_t k = 0; k < 30; ++k) {
    for (std::int64_t i = 0; i < 10; ++i) {
      builder->AddImu({kStep_ns * k + kStep_ns / 10 * i + 1});
    }
    KeyframeState state;
    state.t_ns = kStep_ns * k + kStep_ns / 2;
    builder->AddKeyframe(state, seen);
  }
}

TEST(NoMemory, NoCallOfTheBuilderThrowsAndItGoesOn) {
  SegmentBuilderOptions options;
  options.session = "a session with a name that is not a short string";
  options.keyframes = 6;
  const std::vector<KeyframeObservation> seen = {{0, 1}, {0, 2}, {0, 3}};
  int failures = 0;
  for (int allocation = 0;; ++allocation) {
    ASSERT_LT(allocation, 10'000);
    std::optional<SegmentBuilder> builder;
    bool refused = false;
    const bool failed = Fails(allocation, [&] {
      builder.emplace(options);
      Feed(seen, &*builder);
      builder->Flush(2);
      while (builder->Take()) {
      }
      refused = builder->next_index() == 0;
    });
    if (!failed) break;
    ++failures;
    if (refused) continue;  // there was no memory for the builder itself
    EXPECT_EQ(builder->statistics().out_of_memory, 1u);
    EXPECT_GE(builder->statistics().segments, 3u) << allocation;
    EXPECT_LE(builder->statistics().segments, 5u) << allocation;
  }
  EXPECT_GT(failures, 100);
}

// Its samples have come, but not those around it: what ends is closed as it is.
TEST(NoMemory, TheEndOfHealthDoesNotThrow) {
  const std::vector<KeyframeObservation> seen = {{0, 1}, {0, 2}, {0, 3}};
  int failures = 0;
  for (int allocation = 0;; ++allocation) {
    ASSERT_LT(allocation, 1'000);
    SegmentBuilder builder({.session = "s", .keyframes = 6});
    constexpr std::int64_t kStep_ns = 100'000'000;
    for (std::int64_t t_ns = 1; t_ns <= 6 * kStep_ns + 1; t_ns += 10'000'000) {
      builder.AddImu({t_ns});
    }
    for (std::int64_t k = 0; k < 7; ++k) {
      KeyframeState state;
      state.t_ns = kStep_ns * k + 1;
      ASSERT_TRUE(builder.AddKeyframe(state, seen));
    }
    ASSERT_FALSE(builder.TakeClosed().has_value());
    const bool failed = Fails(allocation, [&] { builder.SetHealthy(false); });
    EXPECT_EQ(builder.statistics().out_of_memory, failed ? 1u : 0u);
    EXPECT_EQ(builder.TakeClosed().has_value(), !failed);
    EXPECT_FALSE(builder.AddKeyframe({}, seen)) << "it is not healthy";
    if (!failed) break;
    ++failures;
  }
  EXPECT_GE(failures, 2) << "its keyframes and its samples";
}

TEST(NoMemory, WhatWasMovedFromRefuses) {
  SegmentBuilder builder({.session = "s"});
  const SegmentBuilder other(std::move(builder));
  // NOLINTNEXTLINE(bugprone-use-after-move): what it does is the contract.
  EXPECT_FALSE(builder.AddImu({1}));
  EXPECT_FALSE(builder.AddKeyframe({}, {}));
  builder.Flush(2);
  EXPECT_FALSE(builder.Take().has_value());
  EXPECT_EQ(builder.next_index(), 0);
}

TEST(NoMemory, NoCallOfAStreamOrAWatchThrows) {
  ClientOptions options;
  options.target = "unix:/nonexistent/selfcal-no-memory-test.sock";
  options.rig = "device";
  options.min_backoff = std::chrono::milliseconds(1);
  int failures = 0;
  int unusable = 0;
  for (int allocation = 0;; ++allocation) {
    ASSERT_LT(allocation, 1000);
    std::optional<SegmentStream> stream;
    std::optional<CalibrationWatch> watch;
    MotionSegment segment;
    segment.key = {"walk", 0};
    const bool failed = Fails(allocation, [&] {
      stream.emplace(options, nullptr);
      watch.emplace(options, nullptr);
      stream->Send(std::move(segment));
      stream->Send(ClosedSegment{});
      stream->statistics();
      std::ignore = stream->Drain(std::chrono::milliseconds(1));
      std::ignore = stream->spool_status();
      std::ignore = stream->connection_status();
      std::ignore = watch->connection_status();
    });
    if (!failed) break;
    ++failures;
    if (absl::IsResourceExhausted(stream->connection_status())) ++unusable;
  }
  EXPECT_GT(failures, 5);
  EXPECT_GT(unusable, 0);
}

}  // namespace
}  // namespace selfcal::client
