// Segments that leave everything for good: because of a run, or by hand.
#include <algorithm>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class QuarantineTest : public StoreTest {
 protected:
  // Tables of four, full: the first run is pending.
  QuarantineTest() {
    rig_ = TestRig("a");
    rig_.table_size = 4;
    EXPECT_TRUE(domain_->CreateRig(rig_).ok());
    for (int k = 0; k < 4; ++k) {
      Put("a", k);
      Score(rig_, k, k);
    }
  }

  // What a run found that does not use segment 1.
  StoredCalibration Found(CalibrationState state) const {
    StoredCalibration found;
    found.state = state;
    found.theta = rig_.factory;
    const int size = TangentSize(rig_.factory);
    found.covariance = Eigen::MatrixXd::Identity(size, size);
    found.report = CalibrationResult();
    for (int k = 0; k < 4; ++k) {
      SegmentFit fit;
      fit.key = {"s", k};
      if (k == 1) fit.excluded = "it contradicts the others";
      found.report->segment_fits.push_back(fit);
    }
    return found;
  }

  void FinishFirstRun(CalibrationState state) {
    ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
    const auto finished = domain_->FinishRun("a", 1, Found(state));
    ASSERT_TRUE(finished.ok()) << finished.status();
    ASSERT_EQ(finished->state, state);
  }

  QuarantineCommit ByHand(std::optional<std::int64_t> index) {
    const auto commit =
        domain_->QuarantineSegments("a", "s", index, "alice", "diverged");
    EXPECT_TRUE(commit.ok()) << commit.status();
    return commit.value_or(QuarantineCommit());
  }

  StoredSegment Stored(std::int64_t index) {
    const auto segment = store_->GetSegment("a", {"s", index});
    EXPECT_TRUE(segment.ok()) << segment.status();
    return segment.value_or(StoredSegment());
  }

  std::vector<std::string> Details() {
    std::vector<std::string> details;
    const auto events = store_->ListEvents({1000, ""});
    for (const StoredEvent& event : events->items) {
      if (event.kind == EventKind::kSegmentQuarantined) {
        details.push_back(event.detail);
      }
    }
    return details;
  }

  Rig rig_;
};
SELFCAL_STORE_TEST_SUITE(QuarantineTest);

TEST_P(QuarantineTest, ARunThatBecomesActiveQuarantinesWhatItDoesNotUse) {
  FinishFirstRun(CalibrationState::kActive);
  Reopen();
  const StoredSegment segment = Stored(1);
  EXPECT_EQ(segment.state, SegmentState::kUnusable);
  EXPECT_THAT(segment.problem, HasSubstr("run 1"));
  EXPECT_THAT(segment.problem, HasSubstr("it contradicts the others"));
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 2, 3));
  EXPECT_FALSE(HasData("a", 1));
  EXPECT_TRUE(HasData("a", 2));
  EXPECT_THAT(Details(), ElementsAre(HasSubstr("s~1")));
  // A segment that takes its place does not make the tables other enough.
  EXPECT_TRUE(absl::IsNotFound(store_->GetRun("a", 2).status()));
}

TEST_P(QuarantineTest, ARejectedRunQuarantinesNothing) {
  FinishFirstRun(CalibrationState::kRejected);
  EXPECT_EQ(Stored(1).state, SegmentState::kScored);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(Details(), IsEmpty());
}

TEST_P(QuarantineTest, ThinnerTablesFillAndStartRunsAsBefore) {
  FinishFirstRun(CalibrationState::kActive);
  Put("a", 4);
  EXPECT_FALSE(Score(rig_, 4, 10).started_run.has_value());
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 2, 3, 4));
  Put("a", 5);
  const auto started = Score(rig_, 5, -1).started_run;
  EXPECT_FALSE(started.has_value());  // one of four is new
  Put("a", 6);
  const auto second = Score(rig_, 6, -2).started_run;
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(second->trigger, RunTrigger::kTablesChanged);
  EXPECT_THAT(second->segments,
              ElementsAre(SegmentKey{"s", 0},
                          SegmentKey{"s", 2},
                          SegmentKey{"s", 5},
                          SegmentKey{"s", 6}));
}

TEST_P(QuarantineTest, WhatIsQuarantinedIsNotHeldOut) {
  Put("a", 4);
  Score(rig_, 4, 99);  // enters no table, and is not of the run
  ASSERT_THAT(*domain_->ListHeldOut("a", 1, 8), SizeIs(1));
  EXPECT_EQ(ByHand(4).quarantined, 1);
  EXPECT_THAT(*domain_->ListHeldOut("a", 1, 8), IsEmpty());
}

TEST_P(QuarantineTest, ByHandTakesOneSegmentAndSaysWhoAndWhy) {
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "by hand").ok());
  EXPECT_EQ(ByHand(2).quarantined, 1);
  EXPECT_EQ(Stored(2).problem, "quarantined by alice: diverged");
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 3));
  EXPECT_FALSE(HasData("a", 2));
  EXPECT_THAT(
      Details(),
      ElementsAre(::testing::AllOf(HasSubstr("s~2"), HasSubstr("alice"))));
  const auto again = ByHand(2);
  EXPECT_EQ(again.quarantined, 0);
  EXPECT_EQ(again.unusable, 1);
  EXPECT_THAT(Details(), SizeIs(1));
}

TEST_P(QuarantineTest, ByHandTakesAWholeSession) {
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "by hand").ok());
  Put("a", 4);  // waits for its score
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0, "other")).ok());
  const auto commit = ByHand(std::nullopt);
  EXPECT_EQ(commit.quarantined, 5);
  EXPECT_THAT(commit.unscored_sequences, ElementsAre(5));
  EXPECT_THAT(TableIndices("a", 0), IsEmpty());
  const auto unscored = store_->ListUnscored(10);
  ASSERT_THAT(*unscored, SizeIs(1));
  EXPECT_EQ(unscored->front().key, (SegmentKey{"other", 0}));
  EXPECT_THAT(Details(), SizeIs(1));
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->CommitScore("a", {"s", 4}, FakeInformation(rig_, 0)).status()));
}

TEST_P(QuarantineTest, WhatIsNotStoredIsNotFound) {
  EXPECT_TRUE(absl::IsNotFound(
      domain_->QuarantineSegments("a", "s", 77, "alice", "x").status()));
  EXPECT_TRUE(absl::IsNotFound(
      domain_->QuarantineSegments("a", "none", {}, "alice", "x").status()));
  EXPECT_TRUE(absl::IsNotFound(
      domain_->QuarantineSegments("b", "s", {}, "alice", "x").status()));
}

TEST_P(QuarantineTest, ARunThatUsesItKeepsTheDataAndIsRejected) {
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  EXPECT_EQ(ByHand(3).quarantined, 1);
  EXPECT_TRUE(HasData("a", 3));
  const auto finished =
      domain_->FinishRun("a", 1, Found(CalibrationState::kActive));
  ASSERT_TRUE(finished.ok()) << finished.status();
  EXPECT_EQ(finished->state, CalibrationState::kRejected);
  EXPECT_THAT(finished->reasons, ElementsAre(HasSubstr("s~3")));
  EXPECT_FALSE(HasData("a", 3));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  EXPECT_EQ(Stored(1).state, SegmentState::kScored);
}

}  // namespace
}  // namespace selfcal::server
