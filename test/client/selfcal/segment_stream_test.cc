#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/client/selfcal/test_segments.h"
#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

using Mishap = FakeDaemon::Mishap;
using Verdict = Acknowledgement::Verdict;

// Acknowledgements in the order of their coming.
class Acks {
 public:
  SegmentStream::AckCallback Callback() {
    return [this](const Acknowledgement& ack) {
      std::lock_guard lock(mutex_);
      acks_.push_back(ack);
    };
  }
  std::vector<Acknowledgement> all() const {
    std::lock_guard lock(mutex_);
    return acks_;
  }
  std::vector<SegmentKey> keys() const {
    std::vector<SegmentKey> keys;
    for (const Acknowledgement& ack : all()) keys.push_back(ack.key);
    return keys;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Acknowledgement> acks_;
};

class SegmentStreamTest : public ::testing::Test {
 protected:
  ClientOptions Options() const {
    ClientOptions options;
    options.target = daemon_.target();
    options.rig = "device";
    options.max_queue = 100;
    options.min_backoff = std::chrono::milliseconds(1);
    options.max_backoff = std::chrono::milliseconds(20);
    return options;
  }

  FakeDaemon daemon_;
  Acks acks_;
};

TEST_F(SegmentStreamTest, AcknowledgesEverySegmentInOrder) {
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
  ASSERT_TRUE(DrainFully(&stream).ok());

  EXPECT_EQ(acks_.keys(), Keys(0, 50));
  EXPECT_THAT(daemon_.connections(), testing::ElementsAre(Keys(0, 50)));
  const StreamStatistics statistics = stream.statistics();
  EXPECT_EQ(statistics.queued, 50u);
  EXPECT_EQ(statistics.stored, 50u);
  EXPECT_EQ(statistics.resent, 0u);
  EXPECT_EQ(statistics.connections, 1u);
  EXPECT_TRUE(stream.connection_status().ok());
}

TEST_F(SegmentStreamTest, ConnectsOnlyWhenThereIsSomethingToSend) {
  SegmentStream stream(Options(), acks_.Callback());
  EXPECT_TRUE(DrainFully(&stream).ok());
  EXPECT_TRUE(stream.connection_status().ok());
}

TEST_F(SegmentStreamTest, SendsAgainInOrderWhatWasNotAcknowledged) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    FakeDaemon daemon;
    daemon.SetMishaps([&random](const SegmentKey&) {
      switch (random() % 8) {
        case 0:
          return Mishap::kDropAcknowledgement;
        case 1:
          return Mishap::kDropRequest;
        default:
          return Mishap::kNone;
      }
    });
    daemon.Start();
    ClientOptions options = Options();
    options.target = daemon.target();
    options.max_unacknowledged = 1 + trial % 7;
    Acks acks;
    SegmentStream stream(options, acks.Callback());
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
    ASSERT_TRUE(DrainFully(&stream).ok());

    EXPECT_EQ(acks.keys(), Keys(0, 40)) << "each exactly once, and in order";
    EXPECT_EQ(daemon.stored().size(), 40u);
    std::size_t sent = 0;
    for (const auto& connection : daemon.connections()) {
      sent += connection.size();
      for (std::size_t i = 1; i < connection.size(); ++i) {
        EXPECT_EQ(connection[i].index, connection[i - 1].index + 1);
      }
    }
    const StreamStatistics statistics = stream.statistics();
    EXPECT_EQ(statistics.stored + statistics.duplicates, 40u);
    // What was sent into a connection that broke may never have arrived.
    EXPECT_GE(statistics.resent + 40, sent);
    EXPECT_GE(daemon.connections().size(), 2u);
    EXPECT_EQ(statistics.rejected, 0u);
  }
}

TEST_F(SegmentStreamTest, SurvivesRestartsOfTheDaemon) {
  SegmentStream stream(Options(), acks_.Callback());
  daemon_.Hold(true);
  std::int64_t next = 0;
  for (int restart = 0; restart < 5; ++restart) {
    const std::size_t before = daemon_.requests();
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(stream.Send(Segment(next++)));
    daemon_.Start();
    ASSERT_TRUE(daemon_.WaitForRequests(before + 1));
    if (restart % 2 == 1) {
      daemon_.Hold(false);
      ASSERT_TRUE(DrainFully(&stream).ok());
      daemon_.Hold(true);
    }
    daemon_.Stop();
  }
  daemon_.Start();
  daemon_.Hold(false);
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks_.keys(), Keys(0, next));
  EXPECT_GT(stream.statistics().resent, 0u);
}

TEST_F(SegmentStreamTest, ReportsARejectionAndGoesOn) {
  daemon_.Reject({"walk", 3});
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
  ASSERT_TRUE(DrainFully(&stream).ok());
  const auto acks = acks_.all();
  ASSERT_EQ(acks_.keys(), Keys(0, 8));
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(acks[i].verdict, i == 3 ? Verdict::kRejected : Verdict::kStored);
  }
  ASSERT_EQ(acks[3].violations.size(), 1u);
  EXPECT_EQ(acks[3].violations[0].field, "keyframes[0].q_gi");
  EXPECT_FALSE(acks[3].violations[0].message.empty());
  EXPECT_EQ(stream.statistics().rejected, 1u);
  EXPECT_EQ(stream.statistics().connections, 1u);
}

TEST_F(SegmentStreamTest, ReportsADuplicateAsSuch) {
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  ASSERT_TRUE(stream.Send(Segment(0)));
  ASSERT_TRUE(stream.Send(Segment(0)));
  ASSERT_TRUE(DrainFully(&stream).ok());
  ASSERT_EQ(acks_.all().size(), 2u);
  EXPECT_EQ(acks_.all()[0].verdict, Verdict::kStored);
  EXPECT_EQ(acks_.all()[1].verdict, Verdict::kDuplicate);
}

TEST_F(SegmentStreamTest, DropsAndCountsWhatTheQueueHasNoRoomFor) {
  ClientOptions options = Options();
  options.max_queue = 16;
  SegmentStream stream(options, acks_.Callback());
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(stream.Send(Segment(i)));
  for (int i = 16; i < 21; ++i) EXPECT_FALSE(stream.Send(Segment(i)));
  EXPECT_EQ(stream.statistics().dropped, 5u);
  EXPECT_EQ(stream.Drain(std::chrono::milliseconds(1)).code(),
            absl::StatusCode::kDeadlineExceeded);
  daemon_.Start();
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks_.keys(), Keys(0, 16));
  EXPECT_TRUE(stream.Send(Segment(16)));
}

TEST_F(SegmentStreamTest, SendsNoMoreThanTheWindowWithoutAnAnswer) {
  daemon_.Hold(true);
  daemon_.Start();
  ClientOptions options = Options();
  options.max_unacknowledged = 3;
  SegmentStream stream(options, acks_.Callback());
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
  ASSERT_TRUE(daemon_.WaitForRequests(3));
  daemon_.Hold(false);
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(daemon_.max_unanswered(), 3);
}

TEST_F(SegmentStreamTest, EndsAtAnErrorThatWouldComeAgain) {
  daemon_.Start();
  for (const auto code : {grpc::StatusCode::NOT_FOUND,
                          grpc::StatusCode::INVALID_ARGUMENT,
                          grpc::StatusCode::PERMISSION_DENIED,
                          grpc::StatusCode::UNAUTHENTICATED}) {
    daemon_.FailStreamsWith({code, "rigs/device does not exist"});
    SegmentStream stream(Options(), acks_.Callback());
    ASSERT_TRUE(stream.Send(Segment(0)));
    const absl::Status status = DrainFully(&stream);
    EXPECT_EQ(static_cast<int>(status.code()), static_cast<int>(code));
    EXPECT_EQ(status.message(), "rigs/device does not exist");
    EXPECT_EQ(stream.connection_status(), status);
    EXPECT_FALSE(stream.Send(Segment(1)));
    EXPECT_EQ(stream.statistics().dropped, 1u);
  }
  EXPECT_TRUE(acks_.all().empty());
}

TEST_F(SegmentStreamTest, ConnectsAgainAfterAnyOtherError) {
  daemon_.Start();
  for (const auto code : {grpc::StatusCode::UNAVAILABLE,
                          grpc::StatusCode::RESOURCE_EXHAUSTED,
                          grpc::StatusCode::INTERNAL,
                          grpc::StatusCode::DATA_LOSS}) {
    daemon_.FailStreamsWith({code, "the disk is full"});
    SegmentStream stream(Options(), nullptr);
    ASSERT_TRUE(stream.Send(Segment(0)));
    ASSERT_TRUE(Eventually([&] { return !stream.connection_status().ok(); }));
    EXPECT_EQ(stream.connection_status().message(), "the disk is full");
    daemon_.FailStreamsWith(grpc::Status::OK);
    EXPECT_TRUE(DrainFully(&stream).ok());
    EXPECT_TRUE(stream.connection_status().ok());
  }
}

TEST_F(SegmentStreamTest, CanBeDestroyedInAnyState) {
  for (int trial = 0; trial < 20; ++trial) {
    // NOLINTNEXTLINE(bugprone-unused-raii): destroyed as soon as it is made.
    SegmentStream(Options(), acks_.Callback());
    SegmentStream stream(Options(), acks_.Callback());
    stream.Send(Segment(0));  // nobody listens
    if (trial % 2 == 0) {
      ASSERT_TRUE(Eventually([&] { return !stream.connection_status().ok(); }));
    }
  }
  daemon_.Hold(true);
  daemon_.Start();
  for (std::size_t trial = 1; trial <= 20; ++trial) {
    SegmentStream stream(Options(), acks_.Callback());
    stream.Send(Segment(0));
    ASSERT_TRUE(trial % 2 == 1 || daemon_.WaitForRequests(trial / 2));
  }
  ClientOptions backing_off = Options();
  backing_off.target = "unix:" + ::testing::TempDir() + "nobody.sock";
  backing_off.min_backoff = backing_off.max_backoff = std::chrono::hours(1);
  SegmentStream stream(backing_off, acks_.Callback());
  stream.Send(Segment(0));
  ASSERT_TRUE(Eventually([&] { return !stream.connection_status().ok(); }));
}

TEST_F(SegmentStreamTest, CountsCallbacksThatThrowAndGoesOn) {
  daemon_.Start();
  SegmentStream stream(Options(), [](const Acknowledgement& ack) {
    if (ack.key.index % 2 == 0) throw std::runtime_error("a bug");
    if (ack.key.index == 5) throw 5;
  });
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(stream.statistics().stored, 10u);
  EXPECT_EQ(stream.statistics().callback_failures, 6u);
}

TEST_F(SegmentStreamTest, RefusesWhatNoMessageCanCarry) {
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  MotionSegment large = Segment(2);
  large.imu.resize(2'000'000);
  ASSERT_TRUE(stream.Send(Segment(0)));
  ASSERT_TRUE(stream.Send(Segment(1, "not\xff utf-8")));
  ASSERT_TRUE(stream.Send(std::move(large)));
  ASSERT_TRUE(stream.Send(Segment(3)));
  ASSERT_TRUE(stream.Send(Segment(4, std::string(300, 'x'))));
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(daemon_.stored(), (std::set<SegmentKey>{{"walk", 0}, {"walk", 3}}));
  EXPECT_EQ(stream.statistics().rejected, 3u);
  for (const Acknowledgement& ack : acks_.all()) {
    const bool refused = ack.key.index % 3 != 0;
    EXPECT_EQ(ack.verdict, refused ? Verdict::kRejected : Verdict::kStored);
    EXPECT_EQ(ack.violations.size(), refused ? 1u : 0u);
  }
}

TEST_F(SegmentStreamTest, DoesNotTakeAnUnknownVerdictForStored) {
  daemon_.SetMishaps([](const SegmentKey&) { return Mishap::kUnknownVerdict; });
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  ASSERT_TRUE(stream.Send(Segment(0)));
  ASSERT_TRUE(DrainFully(&stream).ok());
  ASSERT_EQ(acks_.all().size(), 1u);
  EXPECT_EQ(acks_.all()[0].verdict, Verdict::kRejected);
}

TEST_F(SegmentStreamTest, LeavesADaemonThatAnswersForAnotherSegment) {
  int mishaps = 2;
  daemon_.SetMishaps([&](const SegmentKey&) {
    return mishaps-- > 0 ? Mishap::kForeignAcknowledgement : Mishap::kNone;
  });
  daemon_.Start();
  SegmentStream stream(Options(), acks_.Callback());
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(stream.Send(Segment(i)));
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_EQ(acks_.keys(), Keys(0, 5));
  EXPECT_GE(daemon_.connections().size(), 2u);
}

TEST_F(SegmentStreamTest, TakesSegmentsFromManyThreads) {
  daemon_.Start();
  ClientOptions options = Options();
  options.max_queue = 1000;
  SegmentStream stream(options, acks_.Callback());
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&stream, t] {
      for (int i = 0; i < 25; ++i) {
        EXPECT_TRUE(stream.Send(Segment(i, "walk" + std::to_string(t))));
        stream.statistics();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_TRUE(DrainFully(&stream).ok());
  std::map<std::string, std::int64_t> next;
  for (const SegmentKey& key : acks_.keys()) {
    EXPECT_EQ(key.index, next[key.session]++);
  }
  EXPECT_EQ(daemon_.stored().size(), 200u);
  EXPECT_EQ(acks_.all().size(), 200u);
}

}  // namespace
}  // namespace selfcal::client
