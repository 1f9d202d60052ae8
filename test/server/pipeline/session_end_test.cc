// The end of a session starts a run where the tables have changed; segments
// that are quarantined leave the queue.
#include "server/domain/clock.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class SessionEndTest : public PipelineTest {
 protected:
  SessionEndTest() {
    options_.recheck = std::chrono::milliseconds(5);
    options_.now_ns = [this] {
      ++looks_;
      return NowNs();
    };
  }
  ~SessionEndTest() override {
    blocked_ = false;
    pipeline_.reset();
  }

  // Nothing is idle for the pipeline: sessions end by hand alone.
  void StopTheClock() {
    options_.now_ns = [this] {
      ++looks_;
      return std::int64_t{0};
    };
  }

  // A run on four segments, and a fifth that changes a quarter of the tables.
  void ChangeTables() {
    Rig rig = TestRig("a");
    rig.table_size = 4;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    StartOne();
    for (int k = 0; k < 4; ++k) Submit(k);
    ASSERT_TRUE(AllScored());
    ASSERT_TRUE(RunIs(RunState::kSucceeded));
    ASSERT_LT(EntropyOf(6), EntropyOf(2));
    Submit(6);
    ASSERT_TRUE(AllScored());
  }

  void BlockScores() {
    estimators_.score =
        [this](const Rig& rig, const Calibration&, const MotionSegment& s) {
          EXPECT_TRUE(Eventually([this] { return !blocked_; }));
          return FakeInformation(rig, EntropyOf(s.key.index));
        };
  }

  // The pipeline has looked whether a run is due, after each session end that
  // was announced became due, and has created none.
  void ExpectNoRun(std::int64_t run) {
    std::this_thread::sleep_for(options_.session_idle);
    const int before = looks_;
    EXPECT_TRUE(Eventually([&] { return looks_ >= before + 3; }));
    EXPECT_TRUE(absl::IsNotFound(store_->GetRun("a", run).status()));
  }

  std::atomic<bool> blocked_ = false;
  // The pipeline asks for the time at the beginning of each look, of which it
  // makes one at a time.
  std::atomic<int> looks_ = 0;
};

TEST_F(SessionEndTest, AnEndedSessionWithChangedTablesStartsARun) {
  StopTheClock();
  options_.session_idle = std::chrono::milliseconds(20);
  ChangeTables();
  ExpectNoRun(2);
  pipeline_->EndSession("a");
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  EXPECT_EQ(store_->GetRun("a", 2)->trigger, RunTrigger::kSessionEnded);
  pipeline_->EndSession("a");
  ExpectNoRun(3);
}

TEST_F(SessionEndTest, ARigThatSendsNoMoreHasEndedItsSession) {
  options_.session_idle = std::chrono::milliseconds(200);
  ChangeTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  EXPECT_EQ(store_->GetRun("a", 2)->trigger, RunTrigger::kSessionEnded);
}

TEST_F(SessionEndTest, AnIdleSessionEndsAfterARestartToo) {
  options_.session_idle = std::chrono::milliseconds(0);
  ChangeTables();
  ExpectNoRun(2);
  options_.session_idle = std::chrono::milliseconds(1);
  Restart();
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
}

// One pass checks a part of them; the next one does not wait for its time.
TEST_F(SessionEndTest, AllRigsAreCheckedAtOnceHoweverManyThereAre) {
  for (int k = 0; k < 250; ++k) {
    ASSERT_TRUE(domain_->CreateRig(TestRig("r" + std::to_string(k))).ok());
  }
  options_.recheck = std::chrono::hours(1);
  StartOne();
  for (const RigCheck check : {RigCheck::kSession, RigCheck::kTime}) {
    EXPECT_TRUE(Eventually([&] {
      return store_->ListRigsToCheck(check, kNoCheck - 1, 1)->empty();
    }));
  }
}

TEST_F(SessionEndTest, ASessionThatGoesOnHasNotEnded) {
  StopTheClock();
  options_.session_idle = std::chrono::milliseconds(150);
  ChangeTables();
  pipeline_->EndSession("a");
  ASSERT_GT(EntropyOf(5), EntropyOf(6));
  Submit(5);  // the client is back
  ExpectNoRun(2);
}

TEST_F(SessionEndTest, TheRunWaitsForScores) {
  StopTheClock();
  options_.session_idle = std::chrono::milliseconds(10);
  BlockScores();
  ChangeTables();
  blocked_ = true;
  ASSERT_LT(EntropyOf(9), EntropyOf(6) + 10);
  Submit(9);
  pipeline_->EndSession("a");
  ExpectNoRun(2);
  blocked_ = false;
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
}

TEST_F(SessionEndTest, QuarantineGivesBackThePlacesOfWhatWaits) {
  options_.max_backlog = 2;
  blocked_ = true;
  BlockScores();
  CreateRig();
  StartOne();
  Submit(0);  // is being scored
  Submit(1);  // waits
  const auto full = pipeline_->Submit("a", Segment(2), [] { return true; });
  ASSERT_TRUE(absl::IsCancelled(full.status()));
  const auto commit = pipeline_->QuarantineSegments("a", "s", 1, "bob", "bad");
  ASSERT_TRUE(commit.ok()) << commit.status();
  EXPECT_EQ(commit->quarantined, 1);
  Submit(2);  // takes that place
  EXPECT_TRUE(absl::IsCancelled(
      pipeline_->Submit("a", Segment(3), [] { return true; }).status()));
  blocked_ = false;
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(store_->GetSegment("a", {"s", 1})->state, SegmentState::kUnusable);
  EXPECT_EQ(store_->GetSegment("a", {"s", 2})->state, SegmentState::kScored);
}

TEST_F(SessionEndTest, WhatIsQuarantinedWhileItIsScoredStaysOut) {
  options_.max_backlog = 1;
  blocked_ = true;
  BlockScores();
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(pipeline_->QuarantineSegments("a", "s", {}, "bob", "bad").ok());
  blocked_ = false;
  Submit(1);  // once the place of the first is free
  ASSERT_TRUE(AllScored());
  const auto segment = store_->GetSegment("a", {"s", 0});
  EXPECT_EQ(segment->state, SegmentState::kUnusable);
  EXPECT_EQ(segment->problem, "quarantined by bob: bad");
}

}  // namespace
}  // namespace selfcal::server
