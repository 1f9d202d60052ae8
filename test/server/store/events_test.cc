// The event log: numbers within a rig, and the order over all rigs.
#include <algorithm>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class EventsTest : public StoreTest {
 protected:
  std::vector<StoredEvent> List(const std::string& rig = "") {
    const auto listed = store_->ListEvents({1000, ""}, rig);
    EXPECT_TRUE(listed.ok()) << listed.status();
    return listed.ok() ? listed->items : std::vector<StoredEvent>();
  }

  // The events of all rigs, read in pages of this size.
  std::vector<StoredEvent> ListInPages(int size, bool newest_first) {
    std::vector<StoredEvent> events;
    Page page{size, ""};
    do {
      const auto listed = newest_first ? store_->ListNewestEvents(page)
                                       : store_->ListEvents(page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) break;
      events.insert(events.end(), listed->items.begin(), listed->items.end());
      page.token = listed->next_token;
    } while (!page.token.empty());
    return events;
  }

  static std::vector<std::int64_t> Numbers(
      const std::vector<StoredEvent>& events) {
    std::vector<std::int64_t> numbers;
    for (const StoredEvent& event : events) numbers.push_back(event.event);
    return numbers;
  }

  static std::vector<std::pair<std::string, std::int64_t>> Names(
      const std::vector<StoredEvent>& events) {
    std::vector<std::pair<std::string, std::int64_t>> names;
    for (const StoredEvent& event : events) {
      names.emplace_back(event.rig, event.event);
    }
    return names;
  }

  // An event of the daemon.
  absl::Status Append(std::int64_t steady_ns) {
    return store_->AppendEvent(
        {0, steady_ns, "", EventKind::kTlsFilesRefused, "x", steady_ns});
  }
};

SELFCAL_STORE_TEST_SUITE(EventsTest);

TEST_P(EventsTest, NumbersAreCountedWithinARig) {
  CreateTestRig("a");
  CreateTestRig("b");
  ASSERT_TRUE(domain_->RecordEvent(EventKind::kTlsFilesRefused, "x").ok());
  // Each rig has its creation and its factory calibration.
  EXPECT_THAT(Numbers(List("a")), ElementsAre(1, 2));
  EXPECT_THAT(Numbers(List("b")), ElementsAre(1, 2));
  const auto all = List();
  ASSERT_THAT(all, SizeIs(5));
  EXPECT_EQ(all.back().rig, "");
  EXPECT_EQ(all.back().event, 1);
}

TEST_P(EventsTest, NumbersGoOnInARigThatIsCreatedAgain) {
  CreateTestRig("a");
  const std::int64_t key = store_->GetActiveCalibration("a")->rig_key;
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "sold").ok());
  CreateTestRig("a");
  EXPECT_NE(store_->GetActiveCalibration("a")->rig_key, key);
  EXPECT_THAT(Numbers(List("a")), ElementsAre(1, 2, 3, 4, 5));
  EXPECT_EQ(List("a")[2].kind, EventKind::kRigDeleted);
  EXPECT_EQ(List("a")[3].kind, EventKind::kRigCreated);
}

TEST_P(EventsTest, LimitedListsHaveOnlyTheEventsOfTheRigThatIsThere) {
  StoredRig north{TestRig("a"), 0};
  north.labels["site"] = "north";
  ASSERT_TRUE(domain_->CreateRig(north).ok());
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "sold").ok());
  RigQuery of_south;
  of_south.choice = RigChoice{{}, {{"site", "south"}}};
  const auto numbers = [&](const std::string& rig, const RigQuery& of) {
    const auto oldest = store_->ListEvents({1000, ""}, rig, of);
    const auto newest = store_->ListNewestEvents({1000, ""}, rig, of);
    EXPECT_TRUE(oldest.ok()) << oldest.status();
    EXPECT_TRUE(newest.ok()) << newest.status();
    auto reversed = Numbers(newest->items);
    std::reverse(reversed.begin(), reversed.end());
    EXPECT_EQ(Numbers(oldest->items), reversed);
    return Numbers(oldest->items);
  };
  for (const char* rig : {"", "a"}) {
    EXPECT_THAT(numbers(rig, of_south), IsEmpty());
  }
  StoredRig south = north;
  south.labels["site"] = "south";
  ASSERT_TRUE(domain_->CreateRig(south).ok());
  for (const char* rig : {"", "a"}) {
    EXPECT_THAT(numbers(rig, of_south), ElementsAre(4, 5)) << rig;
    EXPECT_THAT(numbers(rig, {}), ElementsAre(1, 2, 3, 4, 5)) << rig;
  }
}

TEST_P(EventsTest, PagesOfAllRigsShowEachOnceThoughTimesAreTheSame) {
  now_ns_ = 1'700'000'000'000'000'000;
  for (const char* id : {"a", "b", "c"}) CreateTestRig(id);
  ASSERT_TRUE(domain_->RecordEvent(EventKind::kTlsFilesRefused, "x").ok());
  const auto all = Names(List());
  ASSERT_THAT(all, SizeIs(7));
  for (const int size : {1, 2, 3}) {
    EXPECT_EQ(Names(ListInPages(size, false)), all);
    auto newest = Names(ListInPages(size, true));
    std::reverse(newest.begin(), newest.end());
    EXPECT_EQ(newest, all);
  }
}

TEST_P(EventsTest, AClockThatIsSetBackDoesNotChangeTheOrder) {
  const std::int64_t now_ns = NowNs();
  for (const int hours : {0, -5, 3}) {
    const std::int64_t time_ns = now_ns + hours * 3'600'000'000'000;
    ASSERT_TRUE(store_
                    ->AppendEvent({0,
                                   time_ns,
                                   "",
                                   EventKind::kClockStepped,
                                   "x",
                                   now_ns + 1000 * (std::ssize(List()) + 1)})
                    .ok());
  }
  EXPECT_THAT(Numbers(List()), ElementsAre(1, 2, 3));
}

TEST_P(EventsTest, AnEventOfAnEarlierTimeTakesItsPlace) {
  ASSERT_TRUE(Append(20).ok());
  ASSERT_TRUE(Append(10).ok());
  EXPECT_THAT(Numbers(List()), ElementsAre(2, 1));
}

TEST_P(EventsTest, EventsOfTheDaemonThatComeAtOnceAreAllKept) {
  constexpr int kThreads = 6;
  constexpr int kEach = 20;
  std::vector<std::thread> threads;
  for (int k = 0; k < kThreads; ++k) {
    threads.emplace_back([&] {
      for (int i = 0; i < kEach; ++i) {
        const absl::Status appended = Append(1 + i);
        EXPECT_TRUE(appended.ok()) << appended;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::vector<std::int64_t> numbers = Numbers(List());
  std::sort(numbers.begin(), numbers.end());
  ASSERT_THAT(numbers, SizeIs(kThreads * kEach));
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    EXPECT_EQ(numbers[k], static_cast<std::int64_t>(k) + 1);
  }
}

TEST_P(EventsTest, ATokenOfAnotherListIsRefused) {
  for (const char* id : {"a", "b"}) CreateTestRig(id);
  const Page of_all{1, store_->ListEvents({1, ""})->next_token};
  const Page of_rig{1, store_->ListEvents({1, ""}, "a")->next_token};
  EXPECT_TRUE(absl::IsInvalidArgument(store_->ListEvents(of_rig).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListNewestEvents(of_all).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListEvents(of_all, "a").status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListEvents(of_rig, "b").status()));
}

}  // namespace
}  // namespace selfcal::server
