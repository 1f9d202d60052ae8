#include "server/store/runs.h"

#include "server/store/transact.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class RunsTest : public StoreTest {
 protected:
  // Fills the tables of a new rig (of 2 each): its first run is pending.
  Rig FullRig(const std::string& id) {
    const Rig rig = CreateTestRig(id);
    for (int k = 0; k < rig.table_size; ++k) {
      Put(id, k);
      Score(rig, k, 10 + k);
    }
    return rig;
  }

  StoredCalibration Calibration(const Rig& rig) {
    StoredCalibration calibration;
    calibration.theta = rig.factory;
    const int size = TangentSize(rig.factory);
    calibration.covariance = Eigen::MatrixXd::Identity(size, size);
    return calibration;
  }
};
SELFCAL_STORE_TEST_SUITE(RunsTest);

TEST_P(RunsTest, FullTablesStartOneRunWithTheirSnapshot) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Put("a", 1);
  EXPECT_FALSE(Score(rig, 0, 2.0).started_run.has_value());
  const auto started = Score(rig, 1, 1.0).started_run;
  ASSERT_TRUE(started.has_value());
  EXPECT_EQ(started->run, 1);
  EXPECT_EQ(started->trigger, RunTrigger::kTablesFull);
  EXPECT_EQ(started->base_version, 1);
  EXPECT_THAT(started->segments,
              ElementsAre(SegmentKey{"s", 0}, SegmentKey{"s", 1}));
  Reopen();
  const auto unfinished = store_->ListUnfinishedRuns();
  ASSERT_TRUE(unfinished.ok());
  ASSERT_EQ(unfinished->size(), 1u);
  EXPECT_EQ(unfinished->front().segments, started->segments);
  EXPECT_EQ(unfinished->front().state, RunState::kPending);
}

TEST_P(RunsTest, EveryTriggerIsKept) {
  FullRig("a");
  StoredRun last = store_->GetRun("a", 1).value();
  // The last one is of a later program.
  for (int number = 1; number <= 7; ++number) {
    StoredRun run = last;
    run.run = last.run + 1;
    run.trigger = static_cast<RunTrigger>(number);
    run.change = run.trigger == RunTrigger::kChangeDetected ? 1 : 0;
    last.state = RunState::kCancelled;
    const absl::Status written =
        store_->Transact("a", 1, [&](UnitOfWork* tx) -> absl::Status {
          const absl::Status ended = UpdateRun(tx, last);
          return ended.ok() ? InsertRun(tx, run) : ended;
        });
    ASSERT_TRUE(written.ok()) << written;
    EXPECT_EQ(store_->GetRun("a", run.run)->trigger, run.trigger) << number;
    last = run;
  }
  const auto newest_manual = InspectFor(store_.get(), "a", [](UnitOfWork* tx) {
    return NewestRunOf(tx, {RunTrigger::kManual}, 0);
  });
  EXPECT_EQ(newest_manual.value(), 4);
}

TEST_P(RunsTest, NoSecondRunWhileOneIsUnfinished) {
  const Rig rig = FullRig("a");
  for (int k = 2; k < 6; ++k) {
    Put("a", k);
    EXPECT_FALSE(Score(rig, k, -k).started_run.has_value());
  }
  EXPECT_TRUE(
      absl::IsFailedPrecondition(domain_->CreateManualRun("a").status()));
  EXPECT_EQ(store_->ListRuns("a", {})->items.size(), 1u);
}

TEST_P(RunsTest, UnfinishedRunKeepsItsDataAndItsEndDropsIt) {
  const Rig rig = FullRig("a");
  for (int k = 2; k < 4; ++k) {
    Put("a", k);
    Score(rig, k, -k);
  }
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(3, 2));
  RenewReserve(rig);
  EXPECT_TRUE(HasData("a", 0));
  EXPECT_TRUE(HasData("a", 1));
  Reopen();
  EXPECT_TRUE(HasData("a", 0));
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kFailed, "broke").ok());
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_FALSE(HasData("a", 1));
  EXPECT_TRUE(HasData("a", 2));
  EXPECT_TRUE(HasData("a", 3));
}

TEST_P(RunsTest, FinishingStartsTheNextIfTheTablesHaveChanged) {
  const Rig rig = FullRig("a");
  for (int k = 2; k < 4; ++k) {
    Put("a", k);
    Score(rig, k, -k);
  }
  RenewReserve(rig);
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, Calibration(rig)).ok());
  EXPECT_FALSE(HasData("a", 0));
  const auto next = store_->GetRun("a", 2);
  ASSERT_TRUE(next.ok()) << next.status();
  EXPECT_EQ(next->trigger, RunTrigger::kTablesChanged);
  EXPECT_EQ(next->base_version, 2);
  EXPECT_THAT(next->segments,
              ElementsAre(SegmentKey{"s", 2}, SegmentKey{"s", 3}));
}

TEST_P(RunsTest, LaterRunNeedsEnoughNewSegments) {
  Rig rig = TestRig("a");
  rig.table_size = 4;
  rig.retrigger_fraction = 0.5;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  for (int k = 0; k < 4; ++k) {
    Put("a", k);
    Score(rig, k, 10 + k);
  }
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, Calibration(rig)).ok());
  Put("a", 4);
  EXPECT_FALSE(Score(rig, 4, 1).started_run.has_value());
  Put("a", 5);
  const auto started = Score(rig, 5, 1).started_run;
  ASSERT_TRUE(started.has_value());
  EXPECT_EQ(started->trigger, RunTrigger::kTablesChanged);
}

TEST_P(RunsTest, FailureIsNotRepeatedOnTheSameTables) {
  const Rig rig = FullRig("a");
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kFailed, "singular").ok());
  Put("a", 2);
  EXPECT_FALSE(Score(rig, 2, 99).started_run.has_value());  // enters nothing
  const auto run = store_->GetRun("a", 1);
  EXPECT_EQ(run->state, RunState::kFailed);
  EXPECT_EQ(run->message, "singular");
  EXPECT_GT(run->end_time_ns, 0);
}

TEST_P(RunsTest, ManualRunBeforeTheTablesAreFullDoesNotReplaceTheFirst) {
  const Rig rig = CreateTestRig("a");
  EXPECT_TRUE(
      absl::IsFailedPrecondition(domain_->CreateManualRun("a").status()));
  Put("a", 0);
  Score(rig, 0, 1.0);
  const auto manual = domain_->CreateManualRun("a");
  ASSERT_TRUE(manual.ok()) << manual.status();
  EXPECT_EQ(manual->trigger, RunTrigger::kManual);
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "").ok());
  Put("a", 1);
  const auto started = Score(rig, 1, 2.0).started_run;
  ASSERT_TRUE(started.has_value());
  EXPECT_EQ(started->trigger, RunTrigger::kTablesFull);
}

TEST_P(RunsTest, AttemptsCountCrashesButNotOrderlyStops) {
  FullRig("a");
  EXPECT_EQ(domain_->BeginRun("a", 1)->attempts, 1);
  Reopen();  // as after a crash
  EXPECT_EQ(store_->ListUnfinishedRuns()->front().state, RunState::kRunning);
  EXPECT_EQ(domain_->BeginRun("a", 1)->attempts, 2);
  const auto released = domain_->ReleaseRun("a", 1);
  ASSERT_TRUE(released.ok()) << released.status();
  EXPECT_EQ(released->state, RunState::kPending);
  EXPECT_EQ(released->attempts, 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(domain_->ReleaseRun("a", 1).status()));
}

TEST_P(RunsTest, EndedRunStaysEnded) {
  FullRig("a");
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "by hand").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(domain_->BeginRun("a", 1).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->EndRun("a", 1, RunState::kFailed, "").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      domain_->EndRun("a", 1, RunState::kSucceeded, "").status()));
  EXPECT_EQ(store_->GetRun("a", 1)->message, "by hand");
  EXPECT_TRUE(store_->ListUnfinishedRuns()->empty());
  EXPECT_TRUE(absl::IsNotFound(store_->GetRun("a", 2).status()));
}

}  // namespace
}  // namespace selfcal::server
