// Several daemons on one database: who does the work of a rig.
#include "server/store/replicas.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "test/server/store/fake_information.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

class ReplicasTest : public StoreTest {
 protected:
  Replicas* replicas() { return store_->replicas(); }

  void Begin(const std::string& replica) {
    const absl::Status status = replicas()->Add(replica);
    ASSERT_TRUE(status.ok()) << status;
  }

  std::optional<RigClaim> Claim(const std::string& rig,
                                const std::string& replica) {
    auto claim = replicas()->Claim(rig, replica);
    EXPECT_TRUE(claim.ok()) << claim.status();
    return claim.value_or(std::nullopt);
  }

  absl::Status Score(const RigClaim& claim, std::int64_t index) {
    return domain_
        ->CommitScore(
            claim, {"s", index}, FakeInformation(TestRig(claim.rig), -10, 5, 1))
        .status();
  }
};
SELFCAL_STORE_TEST_SUITE(ReplicasTest);

TEST_P(ReplicasTest, OneHasTheClaimOfARig) {
  CreateTestRig("a");
  CreateTestRig("b");
  Begin("one");
  Begin("two");
  const auto claim = Claim("a", "one");
  ASSERT_TRUE(claim.has_value());
  EXPECT_EQ(claim->rig, "a");
  EXPECT_EQ(claim->number, 1);
  EXPECT_FALSE(Claim("a", "two").has_value());
  EXPECT_EQ(Claim("b", "two")->number, 1);
}

TEST_P(ReplicasTest, OfManyWhoClaimAtOnceOneSucceeds) {
  CreateTestRig("a");
  constexpr int kReplicas = 8;
  for (int k = 0; k < kReplicas; ++k) Begin(std::to_string(k));
  std::atomic<int> claims = 0;
  std::vector<std::thread> threads;
  for (int k = 0; k < kReplicas; ++k) {
    threads.emplace_back([&, k] {
      if (Claim("a", std::to_string(k))) ++claims;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(claims, 1);
}

TEST_P(ReplicasTest, WhatAReplicaClaimedIsFreeWhenItsRecordIsGone) {
  CreateTestRig("a");
  Begin("one");
  Begin("two");
  ASSERT_TRUE(Claim("a", "one").has_value());
  ASSERT_TRUE(replicas()->Remove("one").ok());
  EXPECT_EQ(Claim("a", "two")->number, 2);
}

TEST_P(ReplicasTest, AnOldClaimWritesNothing) {
  CreateTestRig("a");
  Put("a", 0);
  Begin("one");
  const auto old = Claim("a", "one");
  ASSERT_TRUE(replicas()->Remove("one").ok());
  Begin("two");
  const auto present = Claim("a", "two");
  const absl::Status late = Score(*old, 0);
  EXPECT_TRUE(IsClaimLost(late)) << late;
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->state, SegmentState::kStored);
  EXPECT_TRUE(Score(*present, 0).ok());
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->state, SegmentState::kScored);
}

TEST_P(ReplicasTest, AnOldClaimEndsNoRun) {
  CreateTestRig("a");
  Put("a", 0);
  Begin("one");
  const auto old = Claim("a", "one");
  ASSERT_TRUE(Score(*old, 0).ok());
  const auto run = domain_->CreateManualRun("a");
  ASSERT_TRUE(run.ok()) << run.status();
  ASSERT_TRUE(domain_->BeginRun(*old, run->run).ok());
  ASSERT_TRUE(replicas()->Remove("one").ok());
  Begin("two");
  ASSERT_TRUE(Claim("a", "two").has_value());
  const auto late =
      domain_->EndRun(*old, run->run, RunState::kFailed, "too late");
  EXPECT_TRUE(IsClaimLost(late.status())) << late.status();
  EXPECT_EQ(store_->GetRun("a", run->run)->state, RunState::kRunning);
}

TEST_P(ReplicasTest, AClaimThatIsGivenUpIsFree) {
  CreateTestRig("a");
  Begin("one");
  Begin("two");
  const auto first = Claim("a", "one");
  ASSERT_TRUE(replicas()->Release(*first).ok());
  const auto second = Claim("a", "two");
  EXPECT_EQ(second->number, 2);
  ASSERT_TRUE(replicas()->Release(*first).ok());  // it is not the newest
  EXPECT_FALSE(Claim("a", "one").has_value());
}

TEST_P(ReplicasTest, WhoHasNoRecordClaimsNothing) {
  CreateTestRig("a");
  EXPECT_EQ(replicas()->Claim("a", "none").status().code(),
            absl::StatusCode::kNotFound);
  Begin("one");
  EXPECT_EQ(replicas()->Claim("b", "one").status().code(),
            absl::StatusCode::kNotFound);
}

TEST_P(ReplicasTest, ListsRigsThatHaveWorkAndNobody) {
  for (const char* rig : {"a", "b", "c", "d"}) CreateTestRig(rig);
  for (const char* rig : {"a", "b", "c"}) Put(rig, 0);
  Begin("one");
  ASSERT_TRUE(Score("c", 0).ok());
  ASSERT_TRUE(domain_->CreateManualRun("c").ok());
  auto unclaimed = replicas()->ListUnclaimed(10);
  ASSERT_TRUE(unclaimed.ok()) << unclaimed.status();
  std::sort(unclaimed->begin(), unclaimed->end());
  EXPECT_EQ(*unclaimed, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(replicas()->ListUnclaimed(2)->size(), 2u);

  const auto b = Claim("b", "one");
  const auto c = Claim("c", "one");
  ASSERT_TRUE(Claim("d", "one").has_value());
  EXPECT_EQ(*replicas()->ListUnclaimed(10), std::vector<std::string>{"a"});
  auto busy = replicas()->ListBusy("one");
  ASSERT_TRUE(busy.ok()) << busy.status();
  std::sort(busy->begin(), busy->end(), [](const auto& x, const auto& y) {
    return x.rig < y.rig;
  });
  EXPECT_EQ(*busy, (std::vector<RigClaim>{*b, *c}));
}

TEST_P(ReplicasTest, ListsTheWorkOfAReplica) {
  for (const char* rig : {"a", "b"}) {
    CreateTestRig(rig);
    Put(rig, 0);
    ASSERT_TRUE(Score(rig, 0).ok());
    ASSERT_TRUE(domain_->CreateManualRun(rig).ok());
    Put(rig, 1);
  }
  Begin("one");
  ASSERT_TRUE(Claim("b", "one").has_value());
  EXPECT_EQ(store_->ListUnscored(10)->size(), 2u);
  const auto unscored = store_->ListUnscored(10, "one");
  ASSERT_EQ(unscored->size(), 1u);
  EXPECT_EQ(unscored->front().rig, "b");
  EXPECT_EQ(store_->ListUnfinishedRuns()->size(), 2u);
  const auto runs = store_->ListUnfinishedRuns("one");
  ASSERT_EQ(runs->size(), 1u);
  EXPECT_EQ(runs->front().rig, "b");
  EXPECT_EQ(store_->CountUnscored("a").value(), 1);
}

TEST_P(ReplicasTest, WorkIsCountedAndFoundByRig) {
  for (const char* rig : {"a", "b", "c", "d"}) CreateTestRig(rig);
  for (const char* rig : {"a", "c", "d"}) Put(rig, 0);
  Put("a", 1);
  ASSERT_TRUE(Score("c", 0).ok());
  ASSERT_TRUE(domain_->CreateManualRun("c").ok());
  const auto work = store_->CountWork();
  ASSERT_TRUE(work.ok()) << work.status();
  EXPECT_EQ(work->segments, 3);
  EXPECT_EQ(work->runs, 1);
  const auto busy = store_->FindBusyRigs({"a", "b", "c", "nobody"});
  ASSERT_TRUE(busy.ok()) << busy.status();
  EXPECT_EQ(*busy, (std::set<std::string>{"a", "c"}));
  EXPECT_TRUE(store_->FindBusyRigs({})->empty());
  std::set<std::string> many;
  for (int k = 0; k < 2500; ++k) many.insert("n" + std::to_string(k));
  many.insert({"a", "d", "z"});
  EXPECT_EQ(*store_->FindBusyRigs(many), (std::set<std::string>{"a", "d"}));
}

TEST_P(ReplicasTest, OnlyARecordThatDoesNotBeatIsRemoved) {
  Begin("one");
  const auto before = replicas()->List();
  ASSERT_EQ(before->size(), 1u);
  ASSERT_TRUE(replicas()->Beat("one").ok());
  ASSERT_TRUE(replicas()->Remove(before->front()).ok());
  const auto now = replicas()->List();
  ASSERT_EQ(now->size(), 1u);
  EXPECT_GT(now->front().beat, before->front().beat);
  ASSERT_TRUE(replicas()->Remove(now->front()).ok());
  EXPECT_TRUE(replicas()->List()->empty());
  EXPECT_EQ(replicas()->Beat("one").code(), absl::StatusCode::kNotFound);
}

TEST_P(ReplicasTest, ARigIsDeletedWithItsClaim) {
  CreateTestRig("a");
  Begin("one");
  const auto claim = Claim("a", "one");
  ASSERT_TRUE(domain_->DeleteRig("a", "somebody", "sold").ok());
  CreateTestRig("a");
  Put("a", 0);
  const auto anew = Claim("a", "one");
  ASSERT_TRUE(anew.has_value());
  EXPECT_EQ(anew->number, claim->number);
  EXPECT_TRUE(IsClaimLost(Score(*claim, 0)));
  EXPECT_TRUE(Score(*anew, 0).ok());
}

}  // namespace
}  // namespace selfcal::server
