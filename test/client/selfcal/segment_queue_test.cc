#include "client/selfcal/segment_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "test/client/selfcal/no_wait.h"
#include "test/client/selfcal/test_segments.h"
#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

using Verdict = Acknowledgement::Verdict;

// A queue that no thread works on: the tests do the keeper's and the sender's
// part.
class SegmentQueueTest : public ::testing::Test {
 protected:
  static ClientOptions Options() {
    ClientOptions options;
    options.rig = "device";
    options.max_queue = 4;
    options.max_unacknowledged = 2;
    return options;
  }
  // As the keeper does, without a spool.
  void MoveToWindow(std::uint64_t number) {
    ASSERT_TRUE(queue_.TakeIncoming().has_value());
    queue_.Append(Encoded(number));
  }
  bool Acknowledge(std::int64_t index, Verdict verdict = Verdict::kStored) {
    return queue_.Acknowledge({{"walk", index}, verdict, {}});
  }

  SegmentQueue queue_{Options()};
};

TEST_F(SegmentQueueTest, HoldsNoMoreSegmentsThanItMay) {
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(queue_.Push(Segment(i)));
  MoveToWindow(0);
  ASSERT_TRUE(queue_.TakeIncoming().has_value());  // the keeper works on it
  EXPECT_EQ(queue_.unacknowledged(), 2u);
  for (int i = 2; i < 4; ++i) ASSERT_TRUE(queue_.Push(Segment(i)));
  EXPECT_FALSE(queue_.Push(Segment(4))) << "one here, one there, two waiting";
  EXPECT_EQ(queue_.unacknowledged(), 4u);
  queue_.Append(Encoded(1));
  EXPECT_FALSE(queue_.Push(Segment(4))) << "it is only elsewhere";
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  ASSERT_TRUE(Acknowledge(0));
  EXPECT_TRUE(queue_.Push(Segment(4)));
  EXPECT_FALSE(queue_.Push(Segment(5)));
  EXPECT_EQ(queue_.statistics().queued, 5u);
  EXPECT_EQ(queue_.statistics().dropped, 3u);
}

TEST_F(SegmentQueueTest, CountsWhatAssemblyAndDaemonHaveDropped) {
  queue_.NoteAssembled({.tracks_triangulated = 40, .tracks_dropped = 3});
  queue_.NoteAssembled({.tracks_triangulated = 50, .tracks_dropped = 4});
  ASSERT_TRUE(queue_.Push(Segment(0)));
  MoveToWindow(0);
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  ASSERT_TRUE(queue_.Acknowledge({{"walk", 0}, Verdict::kStored, {}, 6, 5}));
  EXPECT_EQ(queue_.statistics().tracks_triangulated, 90u);
  EXPECT_EQ(queue_.statistics().tracks_dropped, 7u);
  EXPECT_EQ(queue_.statistics().observations_dropped, 6u);
  EXPECT_EQ(queue_.statistics().readings_dropped, 5u);
}

TEST_F(SegmentQueueTest, LeavesRoomForASegmentThatIsReadFromDisk) {
  SpoolReport report;
  report.opened = true;
  report.has_unloaded = true;
  queue_.ReportSpool(report);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(queue_.Push(Segment(i)));
  EXPECT_FALSE(queue_.Push(Segment(3))) << "the sender would have no work";
  ASSERT_TRUE(queue_.ReserveRoom());
  EXPECT_FALSE(queue_.Push(Segment(3))) << "it is being read";
  queue_.Append(Encoded(9, /*on_disk=*/true));
  EXPECT_EQ(queue_.state().in_memory, 4u);
  EXPECT_FALSE(queue_.ReserveRoom());
  EXPECT_FALSE(queue_.Push(Segment(3)));
  // It was the last on disk.
  report.has_unloaded = false;
  queue_.ReportSpool(report);
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  ASSERT_TRUE(Acknowledge(9));
  EXPECT_TRUE(queue_.Push(Segment(3)));
}

TEST_F(SegmentQueueTest, ReleasesTheRoomForASegmentThatCouldNotBeRead) {
  SpoolReport report;
  report.opened = true;
  queue_.ReportSpool(report);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(queue_.Push(Segment(i)));
  ASSERT_TRUE(queue_.ReserveRoom());
  EXPECT_FALSE(queue_.Push(Segment(3)));
  queue_.ReportSpool(report);
  EXPECT_TRUE(queue_.Push(Segment(3)));
}

TEST_F(SegmentQueueTest, IsDoneWhenAllIsAcknowledgedAndCalledBack) {
  SpoolReport opened;
  opened.opened = true;
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "the spool may hold something";
  queue_.ReportSpool(opened);
  EXPECT_TRUE(queue_.WaitUntilDone(kNow));
  ASSERT_TRUE(queue_.Push(Segment(0)));
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "it is incoming";
  ASSERT_TRUE(queue_.TakeIncoming().has_value());
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "the keeper has it";
  queue_.Append(Encoded(0));
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "it is in the window";
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "it is sent";
  ASSERT_TRUE(Acknowledge(0));
  EXPECT_EQ(queue_.unacknowledged(), 0u);
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "the callback is due";
  queue_.CallbackReturned(true);
  EXPECT_TRUE(queue_.WaitUntilDone(kNow));
  EXPECT_EQ(queue_.statistics().callback_failures, 1u);
}

TEST_F(SegmentQueueTest, CountsASegmentOnDiskOnceWhereverElseItIs) {
  SpoolReport opened;
  opened.opened = true;
  queue_.ReportSpool(opened);
  ASSERT_TRUE(queue_.Push(Segment(0)));
  ASSERT_TRUE(queue_.TakeIncoming().has_value());
  EXPECT_EQ(queue_.unacknowledged(), 1u);
  SpoolReport one = opened;
  one.segments = 1;
  queue_.NoteSpooled(one);
  EXPECT_EQ(queue_.unacknowledged(), 1u) << "on disk";
  queue_.Append(Encoded(0, /*on_disk=*/true));
  EXPECT_EQ(queue_.unacknowledged(), 1u) << "in the window, too";
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  ASSERT_TRUE(Acknowledge(0));
  queue_.CallbackReturned(false);
  EXPECT_FALSE(queue_.WaitUntilDone(kNow)) << "its file is there";
  EXPECT_EQ(queue_.state().finished_files, 1u);
  EXPECT_EQ(queue_.TakeFinishedFiles(), std::vector<std::uint64_t>{0});
  EXPECT_TRUE(queue_.TakeFinishedFiles().empty()) << "each once";
  queue_.ReportSpool(opened);
  EXPECT_TRUE(queue_.WaitUntilDone(kNow));
}

TEST_F(SegmentQueueTest, CountsVerdictsRefusalsAndDropsApart) {
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(queue_.Push(Segment(i)));
  for (std::uint64_t i = 0; i < 2; ++i) MoveToWindow(i);
  ASSERT_TRUE(queue_.TakeIncoming().has_value());
  queue_.NoteRefused();
  ASSERT_TRUE(queue_.TakeIncoming().has_value());
  queue_.NoteDropped();
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  ASSERT_NE(queue_.Next(), nullptr);
  EXPECT_TRUE(Acknowledge(0, Verdict::kDuplicate));
  EXPECT_TRUE(Acknowledge(1, Verdict::kRejected));
  EXPECT_FALSE(Acknowledge(1)) << "is gone";
  const StreamStatistics statistics = queue_.statistics();
  EXPECT_EQ(statistics.queued, 4u);
  EXPECT_EQ(statistics.stored, 0u);
  EXPECT_EQ(statistics.duplicates, 1u);
  EXPECT_EQ(statistics.rejected, 2u);
  EXPECT_EQ(statistics.dropped, 1u);
  EXPECT_EQ(queue_.unacknowledged(), 0u);
}

TEST_F(SegmentQueueTest, TakesNothingAfterItsEnd) {
  ASSERT_TRUE(queue_.Push(Segment(0)));
  queue_.End(absl::NotFoundError("no such rig"));
  EXPECT_FALSE(queue_.Push(Segment(1)));
  EXPECT_TRUE(absl::IsNotFound(queue_.end()));
  EXPECT_TRUE(queue_.WaitUntilDone(kNow)) << "nothing will become of it";
  EXPECT_EQ(queue_.unacknowledged(), 1u);

  SegmentQueue stopped(Options());
  stopped.Stop();
  EXPECT_FALSE(stopped.Push(Segment(0)));
  EXPECT_FALSE(stopped.WaitForWork());
  EXPECT_EQ(stopped.Next(), nullptr);
  EXPECT_FALSE(stopped.Pause(kLongWait)) << "does not wait";
}

TEST_F(SegmentQueueTest, EndsTheWaitForTheNextRequestWhenItIsClosed) {
  queue_.Open();
  std::atomic<bool> ended = false;
  std::thread sender([&] {
    EXPECT_EQ(queue_.Next(), nullptr);
    ended = true;
  });
  queue_.Close();
  EXPECT_TRUE(Eventually([&] { return ended.load(); }));
  queue_.Stop();
  sender.join();
}

TEST_F(SegmentQueueTest, EndsTheKeepersWaitAtAnyChangeAndInTime) {
  const auto change_by = [this](const auto& act) {
    const SegmentQueue::State before = queue_.state();
    std::thread other([&] { act(); });
    const SegmentQueue::State after =
        queue_.WaitForChange(before, SegmentQueue::Clock::now() + kLongWait);
    other.join();
    return after;
  };
  const SegmentQueue::State empty = queue_.state();
  EXPECT_EQ(queue_.WaitForChange(empty, SegmentQueue::Clock::now()), empty);
  EXPECT_EQ(change_by([&] { queue_.Push(Segment(0)); }).incoming, 1u);
  MoveToWindow(0);
  EXPECT_EQ(queue_.state().in_window, 1u);
  queue_.Open();
  ASSERT_NE(queue_.Next(), nullptr);
  EXPECT_EQ(change_by([&] { Acknowledge(0); }).in_window, 0u);
  EXPECT_TRUE(change_by([&] { queue_.Finish(); }).finishing);
}

}  // namespace
}  // namespace selfcal::client
