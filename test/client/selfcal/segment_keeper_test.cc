#include "client/selfcal/segment_keeper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "client/selfcal/queue_limits.h"
#include "test/client/selfcal/no_wait.h"
#include "test/client/selfcal/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

using Verdict = Acknowledgement::Verdict;
using Clock = SegmentKeeper::Clock;

// A queue and its keeper, on one thread: the tests do the sender's part.
class Process {
 public:
  explicit Process(const ClientOptions& options)
      : queue_(options),
        keeper_(options, &queue_, [this](const Acknowledgement& refusal) {
          refused_.push_back(refusal.key);
          queue_.CallbackReturned(false);
        }) {
    keeper_.OpenSpool();
  }

  SegmentQueue& queue() { return queue_; }
  const std::vector<SegmentKey>& refused() const { return refused_; }

  // Lets the keeper take one step.
  KeeperStep Step(Clock::time_point now = Clock::now()) {
    return keeper_.ProcessNext(queue_.state(), now);
  }
  // Lets the keeper work until it would wait; returns its steps.
  std::vector<KeeperStep> Work(Clock::time_point now = Clock::now()) {
    std::vector<KeeperStep> steps;
    while (steps.size() < 1000) {
      const KeeperStep step = Step(now);
      if (step == KeeperStep::kWait) return steps;
      steps.push_back(step);
    }
    ADD_FAILURE() << "the keeper does not come to rest";
    return steps;
  }
  // Sends what may be sent on this connection.
  std::vector<std::int64_t> Send() {
    std::vector<std::int64_t> sent;
    // Next waits if nothing may be sent, which the sizes show.
    while (in_flight_.size() <
           std::min<std::size_t>(queue_.state().in_window, window_)) {
      in_flight_.push_back(KeyOf(*queue_.Next()).index);
      sent.push_back(in_flight_.back());
    }
    return sent;
  }
  void Connect() {
    in_flight_.clear();
    queue_.Open();
  }
  // Acknowledges the oldest that was sent, and returns its index.
  std::int64_t Acknowledge() {
    const std::int64_t index = in_flight_.front();
    in_flight_.erase(in_flight_.begin());
    EXPECT_TRUE(queue_.Acknowledge({{"walk", index}, Verdict::kStored, {}}));
    queue_.CallbackReturned(false);
    return index;
  }
  std::size_t in_flight() const { return in_flight_.size(); }
  // Ends as a process does that is not killed.
  void Finish() {
    queue_.Finish();
    keeper_.SpoolRest();
  }

 private:
  const std::size_t window_ = 3;  // Options().max_unacknowledged
  SegmentQueue queue_;
  SegmentKeeper keeper_;
  std::vector<SegmentKey> refused_;
  std::vector<std::int64_t> in_flight_;
};

class SegmentKeeperTest : public ::testing::Test {
 protected:
  ClientOptions Options(bool with_spool) const {
    ClientOptions options;
    options.rig = "device";
    options.max_queue = 4;
    options.max_unacknowledged = 3;
    if (with_spool) options.spool_dir = folder_.path();
    return options;
  }
  std::size_t Files() const {
    std::size_t files = 0;
    for (const auto& file :
         std::filesystem::directory_iterator(folder_.path() / "device")) {
      files += file.path().extension() == ".segment" ? 1 : 0;
    }
    return files;
  }

  // In memory, because the interleavings sync thousands of files.
  TempFolder folder_;
};

TEST_F(SegmentKeeperTest, FillsTheWindowWithoutASpool) {
  Process process(Options(false));
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
  EXPECT_FALSE(process.queue().Push(Segment(4)));
  process.Work();
  EXPECT_EQ(process.queue().state().in_window, 4u);
  EXPECT_FALSE(process.queue().Push(Segment(4))) << "all are in memory";
  process.Connect();
  EXPECT_EQ(process.Send(), (std::vector<std::int64_t>{0, 1, 2}));
  EXPECT_EQ(process.Acknowledge(), 0);
  EXPECT_TRUE(process.queue().Push(Segment(4)));
  process.Work();
  EXPECT_EQ(process.Send(), (std::vector<std::int64_t>{3}));
  while (process.in_flight() > 0) {
    process.Acknowledge();
    process.Send();
  }
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
  EXPECT_EQ(process.queue().statistics().stored, 5u);
}

TEST_F(SegmentKeeperTest, WritesToTheSpoolWhatTheWindowCannotTake) {
  Process process(Options(true));
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(process.queue().Push(Segment(i)));
    process.Work();
    EXPECT_EQ(process.queue().unacknowledged(),
              static_cast<std::size_t>(i + 1));
  }
  EXPECT_EQ(process.queue().state().in_window, 2u) << "half of the queue";
  EXPECT_EQ(process.queue().statistics().spooled, 18u);
  EXPECT_EQ(Files(), 18u);
  process.Connect();
  for (int i = 0; i < 20; ++i) {
    process.Send();
    EXPECT_EQ(process.Acknowledge(), i);
    process.Work();
    EXPECT_LE(process.queue().state().in_window, 2u);
    EXPECT_EQ(process.queue().unacknowledged(),
              static_cast<std::size_t>(19 - i));
  }
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
  EXPECT_EQ(Files(), 0u);
}

TEST_F(SegmentKeeperTest, KeepsOneEncodedSegmentWhileTheSpoolIsFull) {
  ClientOptions options = Options(true);
  options.max_spool_bytes = 0;
  Process process(options);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
  const auto steps = process.Work();
  EXPECT_EQ(std::count(steps.begin(), steps.end(), KeeperStep::kSpool), 1)
      << "not tried again before its time";
  EXPECT_EQ(process.queue().state().in_window, 2u);
  EXPECT_EQ(process.queue().state().incoming, 1u);
  EXPECT_FALSE(process.queue().Push(Segment(4))) << "4 are in memory";
  EXPECT_TRUE(absl::IsResourceExhausted(process.queue().spool_status()));
  process.Connect();
  for (int i = 0; i < 4; ++i) {
    process.Send();
    EXPECT_EQ(process.Acknowledge(), i);
    process.Work();
  }
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
}

TEST_F(SegmentKeeperTest, ReadsNothingBackThatMemoryHasNoRoomFor) {
  Process process(Options(true));
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
  process.Work();  // 0 and 1 are in the window, 2 and 3 on disk
  process.Connect();
  process.Send();
  EXPECT_EQ(process.Acknowledge(), 0);
  EXPECT_EQ(process.Acknowledge(), 1);
  for (int i = 4; i < 7; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
  EXPECT_FALSE(process.queue().Push(Segment(7))) << "room for one on disk";
  EXPECT_EQ(process.Step(), KeeperStep::kLoad) << "the sender has no work";
  EXPECT_EQ(process.queue().state().in_memory, 4u);
  EXPECT_FALSE(process.queue().Push(Segment(7)));
  EXPECT_EQ(process.Step(), KeeperStep::kEncode) << "there is no room to read";
  process.Work();
  for (int i = 2; i < 7; ++i) {
    process.Send();
    EXPECT_EQ(process.Acknowledge(), i);
    process.Work();
  }
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
}

TEST_F(SegmentKeeperTest, SpoolsWithTheSmallestQueue) {
  ClientOptions options = Options(true);
  options.max_queue = 1;  // taken as 2
  Process process(options);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(process.queue().Push(Segment(i)));
    process.Work();
    EXPECT_LE(process.queue().state().in_memory, 2u);
  }
  EXPECT_EQ(process.queue().statistics().spooled, 4u);
  process.Connect();
  for (int i = 0; i < 5; ++i) {
    process.Send();
    EXPECT_EQ(process.Acknowledge(), i);
    process.Work();
  }
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
}

TEST_F(SegmentKeeperTest, RefusesWhatNoMessageCanContain) {
  Process process(Options(false));
  ASSERT_TRUE(process.queue().Push(Segment(0, "not\xff utf-8")));
  ASSERT_TRUE(process.queue().Push(Segment(1)));
  process.Work();
  ASSERT_EQ(process.refused().size(), 1u);
  EXPECT_EQ(process.refused()[0].index, 0);
  EXPECT_EQ(process.queue().statistics().rejected, 1u);
  EXPECT_EQ(process.queue().unacknowledged(), 1u);
  process.Connect();
  EXPECT_EQ(process.Send(), (std::vector<std::int64_t>{1}));
  process.Acknowledge();
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
}

TEST_F(SegmentKeeperTest, LeavesEverythingToTheNextProcess) {
  {
    Process process(Options(true));
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
    process.Work();
    process.Connect();
    process.Send();
    EXPECT_EQ(process.Acknowledge(), 0);
    // The keeper has not seen any of these.
    for (int i = 4; i < 7; ++i) ASSERT_TRUE(process.queue().Push(Segment(i)));
    process.Finish();
  }
  EXPECT_EQ(Files(), 6u);
  Process process(Options(true));
  EXPECT_EQ(process.queue().statistics().spool_recovered, 6u);
  process.Connect();
  for (int i = 1; i < 7; ++i) {
    process.Work();
    process.Send();
    EXPECT_EQ(process.Acknowledge(), i);
  }
  process.Work();
  EXPECT_TRUE(process.queue().WaitUntilDone(kNow));
}

// The SLAM system, the keeper, the sender and the device's owner act in random
// order. Each accepted segment must be acknowledged once, in order, whatever
// happens in between, and the queue may never hold more than it is allowed to.
TEST_F(SegmentKeeperTest, DeliversAllOnceAndInOrderInAnyInterleaving) {
  std::int64_t total = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    std::filesystem::remove_all(folder_.path() / "device");
    ClientOptions options = Options(true);
    options.max_queue = 1 + static_cast<int>(seed % 5);
    if (seed % 3 == 0) options.max_spool_bytes = 20'000;  // three segments
    auto process = std::make_unique<Process>(options);
    bool connected = false;
    std::int64_t accepted = 0;
    std::int64_t acknowledged = 0;
    for (int step = 0; step < 400; ++step) {
      const unsigned act = random() % 16;
      if (act < 5) {
        if (process->queue().Push(Segment(accepted))) ++accepted;
      } else if (act < 10) {
        process->Step();
      } else if (act < 12) {
        if (connected) process->Send();
      } else if (act < 14) {
        if (process->in_flight() == 0) continue;
        ASSERT_EQ(process->Acknowledge(), acknowledged++);
      } else if (act < 15) {
        process->Connect();
        connected = true;
      } else if (random() % 8 == 0) {
        // What does not fit into the spool at the end is lost, as documented.
        if (options.max_spool_bytes < 100'000) continue;
        process->Finish();
        process.reset();  // it has the spool
        process = std::make_unique<Process>(options);
        connected = false;
      }
      const StreamStatistics statistics = process->queue().statistics();
      const SegmentQueue::State state = process->queue().state();
      // A file counts until it is removed.
      ASSERT_EQ(process->queue().unacknowledged(),
                static_cast<std::size_t>(accepted - acknowledged) +
                    state.finished_files);
      ASSERT_LE(state.in_memory, MaxInMemory(options));
      ASSERT_LE(statistics.spool_bytes, options.max_spool_bytes);
    }
    process->Connect();
    while (acknowledged < accepted) {
      process->Work();
      // The spool may be blocked, which ends with time.
      process->Step(Clock::now() + SpooledSegments::kSpoolRetry);
      process->Work();
      process->Send();
      ASSERT_GT(process->in_flight(), 0u) << "a segment is lost";
      ASSERT_EQ(process->Acknowledge(), acknowledged++);
    }
    process->Work();
    EXPECT_TRUE(process->queue().WaitUntilDone(kNow));
    EXPECT_EQ(process->queue().statistics().spool_segments, 0u);
    total += accepted;
  }
  EXPECT_GT(total, 1000);
}

}  // namespace
}  // namespace selfcal::client
