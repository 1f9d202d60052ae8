#include "server/api/watch_queue.h"

#include <gtest/gtest.h>

#include "selfcal/v1/activity_service.pb.h"

namespace selfcal::server {
namespace {

WatchQueue::Encode Naming(const std::string& rig) {
  return [rig] {
    auto change = std::make_unique<v1::Change>();
    change->set_rig(rig);
    return std::make_shared<const WatchUpdate>(std::move(change));
  };
}

// The update that is taken; empty if there is none.
std::string Take(WatchQueue* queue) {
  const WatchQueue::Taken taken = queue->Take();
  if (taken.update == nullptr) return "";
  return static_cast<const v1::Change&>((*taken.update())->message()).rig();
}

TEST(WatchQueue, UpdatesWaitInOrderTheNewestOfEachKey) {
  int arrived = 0;
  WatchQueue queue([&] { ++arrived; });
  queue.Put("a", Naming("a1"));
  queue.Put("b", Naming("b1"));
  queue.Put("a", Naming("a2"));
  EXPECT_EQ(arrived, 2);
  EXPECT_EQ(Take(&queue), "a2");
  EXPECT_EQ(Take(&queue), "b1");
  EXPECT_EQ(Take(&queue), "");
  queue.Put("a", Naming("a3"));
  EXPECT_EQ(Take(&queue), "a3");
}

TEST(WatchQueue, WaitingUpdatesAreTakenBeforeTheEnd) {
  WatchQueue queue;
  queue.Put("a", Naming("a"));
  queue.Close(absl::DataLossError("why"));
  queue.Put("b", Naming("late"));
  EXPECT_EQ(Take(&queue), "a");
  const WatchQueue::Taken end = queue.Take(std::chrono::milliseconds(0));
  EXPECT_TRUE(end.ended);
  EXPECT_TRUE(absl::IsDataLoss(end.status));
}

TEST(WatchQueue, TooManyUpdatesBecomeTheSummaryOrLoseTheOldest) {
  WatchQueue plain;
  WatchQueue summed;
  summed.SetSummary(Naming("all"));
  for (std::size_t i = 0; i <= WatchQueue::kCapacity; ++i) {
    plain.Put(std::to_string(i), Naming(std::to_string(i)));
    summed.Put(std::to_string(i), Naming(std::to_string(i)));
  }
  EXPECT_EQ(Take(&plain), "1");
  EXPECT_EQ(Take(&summed), "all");
  EXPECT_EQ(Take(&summed), "");
}

}  // namespace
}  // namespace selfcal::server
