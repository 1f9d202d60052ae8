#include "server/pipeline/backlog.h"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class BacklogTest : public ::testing::Test {
 protected:
  ~BacklogTest() override {
    backlog_.Close();
    for (std::thread& thread : threads_) thread.join();
  }

  bool Take(const std::string& rig) {
    return backlog_.Take(rig, [] { return false; }).ok();
  }
  // Takes a place on a thread, which notes the rig when it has it. The first
  // question whether the caller has gone comes once it is in the queue.
  void TakeLater(const std::string& rig) {
    threads_.emplace_back([this, rig] {
      bool waits = false;
      const auto counted = [&] {
        if (!std::exchange(waits, true)) ++waiting_;
        return false;
      };
      if (!backlog_.Take(rig, counted).ok()) return;
      const std::lock_guard lock(mutex_);
      order_.push_back(rig);
    });
  }
  std::vector<std::string> Order() {
    const std::lock_guard lock(mutex_);
    return order_;
  }

  Backlog backlog_{3};
  std::atomic<int> waiting_{0};
  std::mutex mutex_;
  std::vector<std::string> order_;
  std::vector<std::thread> threads_;
};

TEST_F(BacklogTest, IsClosedBeforeOpenAndAfterClose) {
  EXPECT_TRUE(absl::IsUnavailable(backlog_.Take("a", [] { return false; })));
  backlog_.Open({});
  EXPECT_TRUE(Take("a"));
  backlog_.Close();
  EXPECT_TRUE(absl::IsUnavailable(backlog_.Take("a", [] { return false; })));
}

TEST_F(BacklogTest, ARigWithoutAPlaceDoesNotWaitForOthers) {
  backlog_.Open({{"busy", 3}});
  TakeLater("busy");
  ASSERT_TRUE(Eventually([&] { return waiting_ == 1; }));
  EXPECT_TRUE(Take("quiet"));
  EXPECT_TRUE(Order().empty());
  // Its second place is one of those that all share.
  bool gone = false;
  EXPECT_TRUE(absl::IsCancelled(
      backlog_.Take("quiet", [&] { return std::exchange(gone, true); })));
}

TEST_F(BacklogTest, TheRigWithTheFewestPlacesIsNext) {
  backlog_.Open({{"busy", 3}, {"quiet", 1}});
  TakeLater("busy");
  ASSERT_TRUE(Eventually([&] { return waiting_ == 1; }));
  TakeLater("busy");
  TakeLater("quiet");
  // All are in the queue before there is room.
  ASSERT_TRUE(Eventually([&] { return waiting_ == 3; }));
  EXPECT_TRUE(Order().empty());
  backlog_.Return("busy");
  backlog_.Return("busy");
  ASSERT_TRUE(Eventually([&] { return Order().size() == 1; }));
  // busy has 1 and quiet 1 before: the first who came; then quiet has fewer.
  backlog_.Return("quiet");
  ASSERT_TRUE(Eventually([&] { return Order().size() >= 2; }));
  EXPECT_EQ(Order()[1], "quiet");
}

TEST_F(BacklogTest, PlacesOfARigThatAreReturnedTogetherAreFree) {
  backlog_.Open({{"a", 3}});
  backlog_.Return("a", 3);
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(Take("a"));
  bool gone = false;
  EXPECT_TRUE(absl::IsCancelled(
      backlog_.Take("a", [&] { return std::exchange(gone, true); })));
}

}  // namespace
}  // namespace selfcal::server
