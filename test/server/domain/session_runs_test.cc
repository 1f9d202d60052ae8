// Runs at the end of a session, and runs by hand on tables that have not
// changed.
#include "server/domain/clock.h"
#include "test/server/store/fake_ends.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class SessionRunsTest : public StoreTest {
 protected:
  SessionRunsTest() {
    rig_ = TestRig("a");
    rig_.table_size = 4;
    EXPECT_TRUE(domain_->CreateRig(rig_).ok());
  }

  void Arrive(std::int64_t index, double entropy) {
    Put("a", index);
    Score(rig_, index, entropy);
  }
  void FillTables() {
    for (int k = 0; k < 4; ++k) Arrive(k, 10 + k);
  }

  void Finish(std::int64_t run,
              CalibrationState state = CalibrationState::kActive) {
    StoredCalibration found;
    found.state = state;
    found.theta = rig_.factory;
    const int size = TangentSize(rig_.factory);
    found.covariance = Eigen::MatrixXd::Identity(size, size);
    ASSERT_TRUE(domain_->BeginRun("a", run).ok());
    const auto finished = domain_->FinishRun("a", run, found);
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  std::vector<StoredRun> End(const std::vector<std::string>& ended = {"a"},
                             std::int64_t idle_since_ns = 0) {
    const auto started = domain_->StartSessionRuns(ended, idle_since_ns);
    EXPECT_TRUE(started.ok()) << started.status();
    return started.value_or(std::vector<StoredRun>());
  }

  Rig rig_;
};
SELFCAL_STORE_TEST_SUITE(SessionRunsTest);

TEST_P(SessionRunsTest, TablesThatHaveChangedStartARunWhenTheSessionEnds) {
  FillTables();
  Finish(1);
  EXPECT_THAT(End(), IsEmpty());
  Put("a", 4);
  ASSERT_FALSE(Score(rig_, 4, 1).started_run.has_value());  // a quarter is new
  const auto started = End();
  ASSERT_THAT(started, SizeIs(1));
  EXPECT_EQ(started[0].trigger, RunTrigger::kSessionEnded);
  EXPECT_THAT(started[0].segments,
              ElementsAre(SegmentKey{"s", 0},
                          SegmentKey{"s", 1},
                          SegmentKey{"s", 2},
                          SegmentKey{"s", 4}));
  Reopen();
  EXPECT_EQ(store_->GetRun("a", 2)->trigger, RunTrigger::kSessionEnded);
  EXPECT_THAT(End(), IsEmpty());  // it is under way
  Finish(2);
  EXPECT_THAT(End(), IsEmpty());  // nothing has changed since
}

// None of which enters a table.
TEST_P(SessionRunsTest, AThirdMoreThatIsRememberedStartsARun) {
  const auto remember = [&](std::int64_t index, double entropy, double gain) {
    Put("a", index);
    const SegmentKey key = {"s", index};
    ASSERT_TRUE(domain_
                    ->CommitScore("a",
                                  key,
                                  FakeInformation(rig_, entropy, gain, 7),
                                  FakeEnds(rig_, key))
                    .ok());
  };
  for (int k = 0; k < 4; ++k) remember(k, 10 + k, 5);
  Finish(1);
  remember(4, 99, 0);
  EXPECT_THAT(End(), IsEmpty());
  remember(5, 99, 0);
  const auto started = End();
  ASSERT_THAT(started, SizeIs(1));
  EXPECT_EQ(started[0].trigger, RunTrigger::kSessionEnded);
  EXPECT_THAT(started[0].segments, SizeIs(4));
  Finish(2);
  EXPECT_THAT(End(), IsEmpty());
  remember(6, 99, 0);
  remember(7, 99, 0);
  EXPECT_THAT(End(), IsEmpty());  // two of eight
  remember(8, 99, 0);
  EXPECT_THAT(End(), SizeIs(1));
}

TEST_P(SessionRunsTest, AFailureIsNotRepeatedOnTheSameTables) {
  FillTables();
  Finish(1);
  Arrive(4, 1);
  ASSERT_THAT(End(), SizeIs(1));
  ASSERT_TRUE(domain_->EndRun("a", 2, RunState::kFailed, "broke").ok());
  EXPECT_THAT(End(), IsEmpty());
}

TEST_P(SessionRunsTest, AnIdleRigHasEndedItsSession) {
  FillTables();
  Finish(1);
  Arrive(4, 1);
  EXPECT_THAT(End({}, NowNs() - 60'000'000'000), IsEmpty());
  EXPECT_THAT(End({"b"}, 0), IsEmpty());
  EXPECT_THAT(End({}, NowNs()), SizeIs(1));
}

TEST_P(SessionRunsTest, TablesThatWereNeverReadyWaitForMore) {
  Arrive(0, 1);
  EXPECT_THAT(End(), IsEmpty());
  ASSERT_TRUE(domain_->CreateManualRun("a").ok());
  Finish(1);
  Arrive(1, 2);
  EXPECT_THAT(End(), IsEmpty());
}

TEST_P(SessionRunsTest, WhatWaitsForItsScoreComesFirst) {
  FillTables();
  Finish(1);
  Arrive(4, 1);
  Put("a", 5);
  EXPECT_THAT(End(), IsEmpty());
  Score(rig_, 5, 99);
  EXPECT_THAT(End(), SizeIs(1));
}

TEST_P(SessionRunsTest, AQuarantineByHandIsAChangeAndOneOfARunIsNot) {
  FillTables();
  StoredCalibration found;
  found.state = CalibrationState::kActive;
  found.theta = rig_.factory;
  const int size = TangentSize(rig_.factory);
  found.covariance = Eigen::MatrixXd::Identity(size, size);
  found.report = CalibrationResult();
  found.report->segment_fits = {{{"s", 0}, 1, 1, {}, "contradicts"}};
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, found).ok());
  EXPECT_THAT(End(), IsEmpty());
  ASSERT_TRUE(domain_->QuarantineSegments("a", "s", 1, "bob", "bad").ok());
  const auto started = End();
  ASSERT_THAT(started, SizeIs(1));
  EXPECT_THAT(started[0].segments,
              ElementsAre(SegmentKey{"s", 2}, SegmentKey{"s", 3}));
}

TEST_P(SessionRunsTest, ARunByHandOnUnchangedTablesHasToBeForced) {
  FillTables();
  Finish(1);
  const auto refused = domain_->CreateManualRun("a");
  ASSERT_TRUE(absl::IsFailedPrecondition(refused.status()));
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("have not changed since version 2"));
  const auto forced = domain_->CreateManualRun("a", true);
  ASSERT_TRUE(forced.ok()) << forced.status();
  Finish(2);
  EXPECT_TRUE(
      absl::IsFailedPrecondition(domain_->CreateManualRun("a").status()));
  Arrive(4, 1);
  EXPECT_TRUE(domain_->CreateManualRun("a").ok());
}

TEST_P(SessionRunsTest, ARunByHandAfterARejectionHasToBeForcedToo) {
  FillTables();
  Finish(1, CalibrationState::kRejected);
  EXPECT_TRUE(
      absl::IsFailedPrecondition(domain_->CreateManualRun("a").status()));
}

TEST_P(SessionRunsTest, ARunByHandAfterAFailureOrAQuarantineIsNone) {
  FillTables();
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kFailed, "broke").ok());
  ASSERT_TRUE(domain_->CreateManualRun("a").ok());
  Finish(2);
  ASSERT_TRUE(domain_->QuarantineSegments("a", "s", 1, "bob", "bad").ok());
  EXPECT_TRUE(domain_->CreateManualRun("a").ok());
}

TEST_P(SessionRunsTest, ARunByHandFromAnotherActiveVersionIsAllowed) {
  FillTables();
  Finish(1);
  ASSERT_TRUE(domain_->CreateManualRun("a", true).ok());
  Finish(2);
  // The last run began at version 2 and made version 3.
  ASSERT_TRUE(domain_->ActivateCalibration("a", 1, "bob", "back").ok());
  EXPECT_TRUE(domain_->CreateManualRun("a").ok());
}

}  // namespace
}  // namespace selfcal::server
