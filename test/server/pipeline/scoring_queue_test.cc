#include "server/pipeline/scoring_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <future>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Time in which a queue that did not wait would be done.
constexpr std::chrono::milliseconds kShortWait{20};

// The store lists what a test gives it, as slowly as the test wants.
class ScoringQueueTest : public ::testing::Test {
 protected:
  ScoringQueueTest() { queue_.Open(); }

  void SetUnscored(
      const std::vector<std::pair<std::string, std::int64_t>>& segments) {
    const std::lock_guard lock(mutex_);
    unscored_.clear();
    for (const auto& [rig, sequence] : segments) {
      unscored_.push_back({rig, {"s", sequence}, sequence, 1});
    }
  }

  absl::StatusOr<std::vector<Store::Unscored>> List() {
    std::vector<Store::Unscored> listed;
    {
      const std::lock_guard lock(mutex_);
      listed = unscored_;
    }
    ++lists_;
    EXPECT_TRUE(Eventually([this] { return !slow_; }));
    return listed;
  }

  // The name of the next segment, such as "a1"; empty once closed.
  std::string Next() {
    const auto claim = queue_.Next();
    if (!claim) return "";
    const std::lock_guard lock(mutex_);
    const std::string name = claim->rig + std::to_string(claim->sequence);
    claims_.insert_or_assign(name, *claim);
    return name;
  }
  ScoringQueue::Claim ClaimOf(const std::string& name) {
    const std::lock_guard lock(mutex_);
    return claims_.at(name);
  }
  // Next on a thread, which has read the list and waits for the store.
  std::future<std::string> BeginNext() {
    const int before = lists_;
    slow_ = true;
    auto next = std::async(std::launch::async, [this] { return Next(); });
    EXPECT_TRUE(Eventually([&] { return lists_ > before; }));
    return next;
  }

  template <typename Result>
  static bool IsReady(const std::future<Result>& future,
                      std::chrono::milliseconds limit = kLongWait) {
    return future.wait_for(limit) == std::future_status::ready;
  }

  // Ends a wait that does not end by itself.
  template <typename Result>
  Result Get(std::future<Result>* future) {
    if (!IsReady(*future)) queue_.Close();
    return future->get();
  }

  std::mutex mutex_;  // guards the next two
  std::vector<Store::Unscored> unscored_;
  std::map<std::string, ScoringQueue::Claim> claims_;
  std::atomic<bool> slow_{false};
  std::atomic<int> lists_{0};
  RigClaims all_rigs_{nullptr, {}, nullptr};
  ScoringQueue queue_{&all_rigs_, [this] { return List(); }};
};

TEST_F(ScoringQueueTest, AnArrivalDoesNotWaitForASlowStoreAndIsNotMissed) {
  auto next = BeginNext();
  SetUnscored({{"a", 1}});
  const auto arrival = std::async(std::launch::async, [&] { queue_.Wake(); });
  EXPECT_TRUE(IsReady(arrival));
  slow_ = false;
  EXPECT_EQ(Get(&next), "a1");
}

TEST_F(ScoringQueueTest, WhatWasScoredSinceItWasListedIsNotClaimedAgain) {
  SetUnscored({{"a", 1}});
  ASSERT_EQ(Next(), "a1");
  auto next = BeginNext();
  SetUnscored({});
  const auto end =
      std::async(std::launch::async, [&] { queue_.End(ClaimOf("a1")); });
  EXPECT_FALSE(IsReady(end, kShortWait)) << "the list is out of date";
  slow_ = false;
  ASSERT_TRUE(IsReady(end));
  SetUnscored({{"a", 2}});
  queue_.Wake();
  EXPECT_EQ(Get(&next), "a2");
}

TEST_F(ScoringQueueTest, WhatWasDeletedSinceItWasListedIsNotClaimed) {
  SetUnscored({{"a", 1}});
  auto next = BeginNext();
  EXPECT_THAT(queue_.BeginChange("a"), IsEmpty());
  SetUnscored({{"b", 1}});
  const auto end =
      std::async(std::launch::async, [&] { queue_.EndChange("a"); });
  EXPECT_FALSE(IsReady(end, kShortWait)) << "the list is out of date";
  slow_ = false;
  EXPECT_EQ(Get(&next), "b1");
}

TEST_F(ScoringQueueTest, NoSegmentIsClaimedOnceItIsClosed) {
  SetUnscored({{"a", 1}});
  auto next = BeginNext();
  queue_.Close();
  slow_ = false;
  EXPECT_EQ(Get(&next), "");
  EXPECT_EQ(Next(), "");
  EXPECT_FALSE(queue_.Pause(kLongWait));
}

TEST_F(ScoringQueueTest, ItIsTheTurnOfTheOldestThatIsClaimed) {
  SetUnscored({{"a", 1}, {"a", 2}, {"a", 3}});
  for (const char* name : {"a1", "a2", "a3"}) ASSERT_EQ(Next(), name);
  EXPECT_TRUE(queue_.WaitForTurn(ClaimOf("a1")));
  auto turn = std::async(std::launch::async,
                         [&] { return queue_.WaitForTurn(ClaimOf("a2")); });
  EXPECT_FALSE(IsReady(turn, kShortWait));
  queue_.End(ClaimOf("a1"));
  EXPECT_TRUE(Get(&turn));
  queue_.Close();
  EXPECT_FALSE(queue_.WaitForTurn(ClaimOf("a3")));
}

TEST_F(ScoringQueueTest, NoneOfARigIsClaimedDuringAChange) {
  SetUnscored({{"a", 1}, {"a", 2}, {"b", 1}});
  ASSERT_EQ(Next(), "a1");
  EXPECT_THAT(queue_.BeginChange("a"), ElementsAre(1));
  EXPECT_EQ(Next(), "b1");
  const auto unclaimed =
      std::async(std::launch::async, [&] { queue_.WaitForClaims("a"); });
  EXPECT_FALSE(IsReady(unclaimed, kShortWait));
  SetUnscored({{"a", 2}});
  queue_.End(ClaimOf("a1"));
  ASSERT_TRUE(IsReady(unclaimed));
  auto next = std::async(std::launch::async, [this] { return Next(); });
  EXPECT_FALSE(IsReady(next, kShortWait));
  queue_.EndChange("a");
  EXPECT_EQ(Get(&next), "a2");
}

}  // namespace
}  // namespace selfcal::server
