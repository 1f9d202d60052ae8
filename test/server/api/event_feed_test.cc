// The feed of changes, with another writer on the same store.
#include "server/api/event_feed.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "test/server/served_store.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

// Collects what a reader of the feed is told, but for events.
class Told {
 public:
  EventFeed::OnChange OnChange() {
    return [this](v1::Change::What what, const std::string& rig) {
      if (what == v1::Change::EVENTS) return;
      const std::lock_guard lock(mutex_);
      told_.emplace_back(what, rig);
      more_.notify_all();
    };
  }
  // Waits until all of these were told, or one of `instead`.
  bool Waits(const std::vector<std::string>& rigs,
             v1::Change::What instead = v1::Change::SEGMENTS) {
    std::unique_lock lock(mutex_);
    return more_.wait_for(lock, std::chrono::seconds(60), [&] {
      const auto is_told = [&](v1::Change::What what, const std::string& rig) {
        return std::ranges::count(told_, std::pair(what, rig)) > 0;
      };
      return is_told(instead, "") || std::ranges::all_of(rigs, [&](auto& rig) {
               return is_told(v1::Change::SEGMENTS, rig);
             });
    });
  }
  std::vector<std::pair<v1::Change::What, std::string>> All() {
    const std::lock_guard lock(mutex_);
    return told_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable more_;
  std::vector<std::pair<v1::Change::What, std::string>> told_;
};

class EventFeedTest : public ServedStore {
 protected:
  // Stores a segment as another daemon does, or as a device's report.
  void Put(const std::string& rig, int index) {
    const auto put =
        domain_->PutSegment(rig, TestSegments(TestRig(rig), 2)[index]);
    ASSERT_TRUE(put.ok()) << put.status();
  }
};

TEST_F(EventFeedTest, SegmentsOfOthersAreReported) {
  AddRig("a");
  AddRig("b");
  Put("a", 0);
  Told all, of_a, of_b;
  const auto all_subscription = feed_.Subscribe("", all.OnChange());
  const auto a_subscription = feed_.Subscribe("a", of_a.OnChange());
  const auto b_subscription = feed_.Subscribe("b", of_b.OnChange());
  Put("b", 0);
  EXPECT_TRUE(all.Waits({"b"}));
  EXPECT_TRUE(of_b.Waits({"b"}));
  Put("a", 1);
  EXPECT_TRUE(all.Waits({"a"}));
  EXPECT_TRUE(of_a.Waits({"a"}));
  EXPECT_THAT(of_a.All(), ElementsAre(Pair(v1::Change::SEGMENTS, "a")));
  EXPECT_THAT(of_b.All(), ElementsAre(Pair(v1::Change::SEGMENTS, "b")));
}

// More than a poll reads: everything may have changed, unless several polls see
// them all.
TEST_F(EventFeedTest, ThoseOfManyRigsAreReportedTogether) {
  std::vector<std::string> rigs;
  for (int k = 0; k < 25; ++k) rigs.push_back("rig-" + std::to_string(k));
  for (const std::string& rig : rigs) AddRig(rig);
  Told all;
  const auto subscription = feed_.Subscribe("", all.OnChange());
  EXPECT_THAT(all.All(), IsEmpty());
  for (const std::string& rig : rigs) Put(rig, 0);
  EXPECT_TRUE(all.Waits(rigs, v1::Change::EVERYTHING));
}

// The pipeline of this daemon says so at once. A poll just between that and the
// commit reports them once more.
TEST_F(EventFeedTest, OwnSegmentsAreUsuallyReportedOnce) {
  const std::vector<std::string> own = {"a", "b", "c"};
  for (const std::string& rig : own) AddRig(rig);
  AddRig("other");
  Told all;
  const auto subscription = feed_.Subscribe("", all.OnChange());
  for (const std::string& rig : own) {
    feed_.OnVerdict(rig, PipelineObserver::Verdict::kStored);
    Put(rig, 0);
  }
  Put("other", 0);
  EXPECT_TRUE(all.Waits({"other"}));
  const auto told = all.All();
  EXPECT_TRUE(std::ranges::any_of(own, [&](const std::string& rig) {
    return std::ranges::count(told, std::pair(v1::Change::SEGMENTS, rig)) == 1;
  }));
}

}  // namespace
}  // namespace selfcal::server
