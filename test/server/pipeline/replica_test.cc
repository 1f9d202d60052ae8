// Several pipelines on one store, as of several daemons on one database.
#include <map>
#include <mutex>

#include "server/store/replicas.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class ReplicaTest : public PipelineTest {
 protected:
  ReplicaTest() {
    options_.replica = {.shared = true,
                        .beat = std::chrono::milliseconds(20),
                        .lease = std::chrono::milliseconds(400)};
    options_.recheck = std::chrono::milliseconds(50);
    estimators_.calibrate = [this](const Rig& rig,
                                   const Calibration& start,
                                   const SegmentSource&,
                                   const CalibrateOptions&,
                                   const ProgressCallback&,
                                   const auto&) {
      const std::lock_guard lock(mutex_);
      ++solves_[rig.id];
      return Converged(rig, start);
    };
  }
  ~ReplicaTest() override { replicas_.clear(); }

  Pipeline* StartAnother() {
    replicas_.push_back(MakePipeline(&*domain_, options_, estimators_));
    const absl::Status status = replicas_.back()->Start();
    EXPECT_TRUE(status.ok()) << status;
    return replicas_.back().get();
  }

  void SubmitTo(Pipeline* replica, const std::string& rig, std::int64_t index) {
    const auto result =
        replica->Submit(rig, Segment(index), [] { return false; });
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_EQ(result->verdict, SubmitResult::Verdict::kStored);
  }

  bool AllRunsHaveEnded() {
    return Eventually([&] { return store_->ListUnfinishedRuns()->empty(); });
  }

  // A replica that holds the rig, and does nothing.
  RigClaim ClaimAsSilentReplica(const std::string& rig) {
    EXPECT_TRUE(store_->replicas()->Add("silent").ok());
    const auto claim = store_->replicas()->Claim(rig, "silent");
    EXPECT_TRUE(claim.ok() && *claim);
    return **claim;
  }

  std::mutex mutex_;  // guards what follows
  std::map<std::string, int> solves_;
  std::vector<std::unique_ptr<Pipeline>> replicas_;
};

TEST_F(ReplicaTest, EachSegmentIsScoredOnceAndEachRunExecutedOnce) {
  constexpr int kRigs = 9;
  constexpr int kSegments = 6;
  for (int k = 0; k < kRigs; ++k) CreateRig(std::to_string(k));
  for (int k = 0; k < 3; ++k) StartAnother();
  // Each segment of a rig arrives at another one.
  for (int index = 0; index < kSegments; ++index) {
    for (int k = 0; k < kRigs; ++k) {
      SubmitTo(replicas_[(index + k) % 3].get(), std::to_string(k), index);
    }
  }
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(AllRunsHaveEnded());
  const std::lock_guard lock(mutex_);
  for (int k = 0; k < kRigs; ++k) {
    const std::string rig = std::to_string(k);
    const auto tables = store_->GetTables(rig);
    ASSERT_TRUE(tables.ok());
    EXPECT_EQ(tables->front().scored, kSegments);
    const auto runs = store_->ListRuns(rig, {50, ""});
    ASSERT_TRUE(runs.ok());
    EXPECT_GE(runs->items.size(), 1u) << rig;
    EXPECT_EQ(solves_[rig], static_cast<int>(runs->items.size())) << rig;
    for (const StoredRun& run : runs->items) EXPECT_EQ(run.attempts, 1);
  }
}

TEST_F(ReplicaTest, ScoresAreCommittedInTheOrderOfArrival) {
  CreateRig("a");
  StartAnother();
  StartAnother();
  for (int index = 0; index < 12; ++index) {
    SubmitTo(replicas_[index % 2].get(), "a", index);
  }
  ASSERT_TRUE(AllScored());
  // As by a single daemon.
  CreateRig("b");
  Pipeline* const one = replicas_.front().get();
  for (int index = 0; index < 12; ++index) SubmitTo(one, "b", index);
  ASSERT_TRUE(AllScored());
  const auto several = store_->GetTables("a");
  const auto single = store_->GetTables("b");
  ASSERT_TRUE(several.ok() && single.ok());
  for (std::size_t t = 0; t < several->size(); ++t) {
    ASSERT_EQ((*several)[t].entries.size(), (*single)[t].entries.size());
    for (std::size_t k = 0; k < (*several)[t].entries.size(); ++k) {
      EXPECT_EQ((*several)[t].entries[k].key, (*single)[t].entries[k].key);
    }
  }
}

TEST_F(ReplicaTest, TheRigsOfOneThatDoesNotRespondAreTakenOver) {
  CreateRig("a");
  const RigClaim old = ClaimAsSilentReplica("a");
  Pipeline* const living = StartAnother();
  SubmitTo(living, "a", 0);
  SubmitTo(living, "a", 1);
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  // What the old one still wants to write is refused.
  EXPECT_TRUE(IsClaimLost(domain_->MarkUnusable(old, {"s", 0}, "late")));
}

TEST_F(ReplicaTest, OneThatRespondsKeepsItsRigs) {
  CreateRig("a");
  const RigClaim claim = ClaimAsSilentReplica("a");
  Pipeline* const other = StartAnother();
  SubmitTo(other, "a", 0);
  const auto until =
      std::chrono::steady_clock::now() + 3 * options_.replica.lease;
  while (std::chrono::steady_clock::now() < until) {
    ASSERT_TRUE(store_->replicas()->Beat("silent").ok());
    std::this_thread::sleep_for(options_.replica.beat);
  }
  EXPECT_EQ(store_->ListUnscored(10)->size(), 1u);
  EXPECT_TRUE(domain_->MarkUnusable(claim, {"s", 0}, "unusable").ok());
}

// The answer to a claim, or to its release, can be lost with the connection.
TEST_F(ReplicaTest, ARigThatItHoldsWithoutItsKnowledgeIsScored) {
  CreateRig("a");
  Pipeline* const replica = StartAnother();
  const auto records = store_->replicas()->List();
  ASSERT_EQ(records->size(), 1u);
  const auto claim = store_->replicas()->Claim("a", records->front().replica);
  ASSERT_TRUE(claim.ok() && *claim);
  SubmitTo(replica, "a", 0);
  ASSERT_TRUE(AllScored());
  // What was begun under the earlier claim is refused.
  EXPECT_TRUE(IsClaimLost(domain_->MarkUnusable(**claim, {"s", 0}, "late")));
}

TEST_F(ReplicaTest, OneThatWasTakenForDeadBeginsAgain) {
  CreateRig("a");
  Pipeline* const replica = StartAnother();
  SubmitTo(replica, "a", 0);
  ASSERT_TRUE(AllScored());
  const auto records = store_->replicas()->List();
  ASSERT_EQ(records->size(), 1u);
  ASSERT_TRUE(store_->replicas()->Remove(records->front().replica).ok());
  SubmitTo(replica, "a", 1);
  ASSERT_TRUE(AllScored());
  EXPECT_TRUE(Eventually([&] {
    const auto now = store_->replicas()->List();
    return now->size() == 1 && now->front().replica != records->front().replica;
  }));
}

TEST_F(ReplicaTest, AStopLeavesTheRigsToTheOthersAtOnce) {
  options_.replica.lease = std::chrono::hours(1);
  CreateRig("a");
  Pipeline* const first = StartAnother();
  SubmitTo(first, "a", 0);
  ASSERT_TRUE(AllScored());
  Pipeline* const second = StartAnother();
  first->Stop();
  SubmitTo(second, "a", 1);
  EXPECT_TRUE(AllScored());
}

TEST_F(ReplicaTest, TheBacklogIsThatOfTheSegmentsThatNobodyHasScored) {
  options_.max_backlog = 2;
  CreateRig("a");
  Pipeline* const holder = StartAnother();
  SubmitTo(holder, "a", 0);
  ASSERT_TRUE(AllScored());
  Pipeline* const other = StartAnother();
  for (int index = 1; index < 12; ++index) SubmitTo(other, "a", index);
  EXPECT_TRUE(AllScored());
}

TEST_F(ReplicaTest, ARunIsCancelledThroughAnyOfThem) {
  const auto is_solving = std::make_shared<std::atomic<bool>>(false);
  estimators_.calibrate = [is_solving](const Rig&,
                                       const Calibration& start,
                                       const SegmentSource&,
                                       const CalibrateOptions&,
                                       const ProgressCallback& progress,
                                       const auto&) {
    *is_solving = true;
    int k = 0;
    EXPECT_TRUE(Eventually([&] { return !progress({++k, 100, 1.0, 1.0}); }));
    return Cancelled(start);
  };
  CreateRig("a");
  Pipeline* const holder = StartAnother();
  SubmitTo(holder, "a", 0);
  SubmitTo(holder, "a", 1);
  ASSERT_TRUE(Eventually([&] { return is_solving->load(); }));
  Pipeline* const other = StartAnother();
  const auto cancelled = other->CancelRecalibration("a", 1);
  ASSERT_TRUE(cancelled.ok()) << cancelled.status();
  EXPECT_EQ(cancelled->state, RunState::kCancelled);
  EXPECT_TRUE(RunIs(RunState::kCancelled));
}

}  // namespace
}  // namespace selfcal::server
