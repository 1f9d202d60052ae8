#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using RigOrder = RigQuery::Order;

class RigSummariesTest : public StoreTest {
 protected:
  // Names of all pages together.
  std::vector<std::string> Names(const RigQuery& query, int page_size = 2) {
    std::vector<std::string> names;
    Page page{page_size, ""};
    do {
      const auto listed = store_->ListRigSummaries(query, page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return names;
      EXPECT_LE(static_cast<int>(listed->items.size()), page_size);
      for (const RigSummary& rig : listed->items) names.push_back(rig.rig);
      page.token = listed->next_token;
    } while (!page.token.empty());
    return names;
  }
};
SELFCAL_STORE_TEST_SUITE(RigSummariesTest);

TEST_P(RigSummariesTest, PagesGoByNameBothWays) {
  for (const char* id : {"c", "a", "e", "b", "d"}) CreateTestRig(id);
  EXPECT_THAT(Names({}), ElementsAre("a", "b", "c", "d", "e"));
  EXPECT_THAT(Names({"", {}, RigOrder::kName, true, ""}),
              ElementsAre("e", "d", "c", "b", "a"));
}

TEST_P(RigSummariesTest, PagesGoByWhenARigWasSeen) {
  const Rig a = CreateTestRig("a");
  const Rig b = CreateTestRig("b");
  CreateTestRig("never");
  CreateTestRig("also-never");
  Put(b.id, 0);
  Put(a.id, 0);
  EXPECT_THAT(Names({"", {}, RigOrder::kLastSeen, false, ""}, 1),
              ElementsAre("also-never", "never", "b", "a"));
  EXPECT_THAT(Names({"", {}, RigOrder::kLastSeen, true, ""}, 1),
              ElementsAre("a", "b", "never", "also-never"));
}

TEST_P(RigSummariesTest, TextIsLookedForInTheName) {
  for (const char* id : {"tablet-1", "phone-1", "tablet-2"}) CreateTestRig(id);
  EXPECT_THAT(Names({"tablet", {}, RigOrder::kName, false, ""}, 1),
              ElementsAre("tablet-1", "tablet-2"));
  const auto with = [&](const std::string& text) {
    return Names({text, {}, RigOrder::kName, false, ""});
  };
  for (const char* nowhere : {"%", "_", "TABLET", "t%t", "t_blet", "\\", "'"}) {
    EXPECT_THAT(with(nowhere), IsEmpty()) << nowhere;
  }
  CreateTestRig("t_blet");
  EXPECT_THAT(with("t_b"), ElementsAre("t_blet"));
  EXPECT_THAT(with("-1"), ElementsAre("phone-1", "tablet-1"));
}

// The search reads an index, so its result is compared with that of a search
// that does not.
TEST_P(RigSummariesTest, EveryTextFindsTheNamesThatContainIt) {
  std::set<std::string> names = {"a",
                                 "aa",
                                 "aaa",
                                 "ab-ba",
                                 "-",
                                 "_",
                                 "__",
                                 "0",
                                 "a_b",
                                 "a-b",
                                 "zzz",
                                 std::string(63, 'x'),
                                 std::string(62, 'x') + "y"};
  for (const std::string& name : names) CreateTestRig(name);
  std::set<std::string> texts = {"",
                                 "%",
                                 "a%",
                                 "\\",
                                 "\\_",
                                 "*",
                                 "?",
                                 "A",
                                 "ä",
                                 "\x7f",
                                 "a\x7f",
                                 "~",
                                 " ",
                                 "'",
                                 std::string(64, 'x'),
                                 "\U0010FFFF"};
  for (const std::string& name : names) {
    for (std::size_t k = 0; k < name.size(); ++k) {
      texts.insert(name.substr(k));
      texts.insert(name.substr(k, 1));
      texts.insert(name.substr(k, 2));
    }
  }
  const auto expect_all = [&] {
    for (const std::string& text : texts) {
      std::vector<std::string> expected;
      for (const std::string& name : names) {
        if (name.find(text) != std::string::npos) expected.push_back(name);
      }
      for (const RigOrder order : {RigOrder::kName, RigOrder::kLastSeen}) {
        EXPECT_EQ(Names({text, {}, order, false, ""}, 3), expected) << text;
      }
    }
  };
  expect_all();
  ASSERT_TRUE(domain_->DeleteRig("aa", "eve", "sold").ok());
  names.erase("aa");
  expect_all();
  CreateTestRig("aa");
  names.insert("aa");
  expect_all();
}

// More places than are read and sorted (kFewNames of rig_lists.cc): these names
// have 2,135 of them, as each letter counts.
TEST_P(RigSummariesTest, ATextThatIsInManyPlacesIsFound) {
  std::vector<std::string> expected;
  for (int k = 10; k < 45; ++k) {
    expected.push_back(std::string(61, 'a') + std::to_string(k));
    CreateTestRig(expected.back());
  }
  CreateTestRig("b");
  for (const RigOrder order : {RigOrder::kName, RigOrder::kLastSeen}) {
    EXPECT_EQ(Names({"a", {}, order, false, ""}, 10), expected);
  }
  std::reverse(expected.begin(), expected.end());
  EXPECT_EQ(Names({"a", {}, RigOrder::kName, true, ""}, 10), expected);
}

TEST_P(RigSummariesTest, ANameIsComparedAsAWhole) {
  for (const char* id : {"tablet", "tablet-2", "my-tablet"}) CreateTestRig(id);
  for (const RigOrder order : {RigOrder::kName, RigOrder::kLastSeen}) {
    EXPECT_THAT(Names({"", {}, order, false, "tablet"}, 1),
                ElementsAre("tablet"));
    EXPECT_THAT(Names({"", {}, order, false, "table"}, 1), IsEmpty());
  }
  EXPECT_THAT(Names({"-2", {}, RigOrder::kName, false, "tablet"}), IsEmpty());
}

TEST_P(RigSummariesTest, TokenOfAnotherQueryIsRefused) {
  for (const char* id : {"a", "b", "c"}) CreateTestRig(id);
  const auto listed = store_->ListRigSummaries({}, {1, ""});
  ASSERT_TRUE(listed.ok());
  for (const Page& page : {Page{1, listed->next_token}, Page{1, "nonsense"}}) {
    EXPECT_TRUE(absl::IsInvalidArgument(
        store_->ListRigSummaries({"a", {}, RigOrder::kName, false, ""}, page)
            .status()));
    EXPECT_TRUE(absl::IsInvalidArgument(
        store_->ListRigSummaries({"", {}, RigOrder::kName, false, "a"}, page)
            .status()));
  }
}

TEST_P(RigSummariesTest, TellsWhatARigHas) {
  const Rig rig = CreateTestRig("a");
  auto listed = store_->ListRigSummaries({}, {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_EQ(listed->items.size(), 1u);
  const RigSummary fresh = listed->items[0];
  EXPECT_EQ(fresh.create_time_ns, store_->GetRig("a")->create_time_ns);
  EXPECT_EQ(fresh.last_seen_ns, 0);
  EXPECT_EQ(fresh.active_version, 1);
  EXPECT_GE(fresh.active_since_ns, fresh.create_time_ns);
  EXPECT_EQ(fresh.newest_version, 1);
  EXPECT_EQ(fresh.newest_state, CalibrationState::kActive);
  EXPECT_EQ(fresh.newest_run, 0);
  EXPECT_EQ(fresh.newest_change_ns, 0);
  ASSERT_EQ(fresh.tables.size(), rig.groups.size());
  EXPECT_THAT(fresh.tables[0].entries, IsEmpty());

  Put("a", 0);
  Score(rig, 0, -10);
  ASSERT_TRUE(domain_->CreateManualRun("a").ok());
  listed = store_->ListRigSummaries({}, {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  const RigSummary used = listed->items[0];
  EXPECT_EQ(used.last_seen_ns,
            store_->GetSegment("a", {"s", 0})->receive_time_ns);
  EXPECT_EQ(used.tables[0].entries.size(), 1u);
  EXPECT_EQ(used.newest_run, 1);
  EXPECT_EQ(used.run_state, RunState::kPending);
}

TEST_P(RigSummariesTest, NewestEventsComeFirst) {
  for (const char* id : {"a", "b"}) CreateTestRig(id);
  const auto oldest = store_->ListEvents({});
  ASSERT_TRUE(oldest.ok());
  std::vector<std::pair<std::string, std::int64_t>> numbers;
  Page page{1, ""};
  do {
    const auto listed = store_->ListNewestEvents(page);
    ASSERT_TRUE(listed.ok()) << listed.status();
    ASSERT_EQ(listed->items.size(), 1u);
    numbers.emplace_back(listed->items[0].rig, listed->items[0].event);
    page.token = listed->next_token;
  } while (!page.token.empty());
  std::reverse(numbers.begin(), numbers.end());
  ASSERT_EQ(numbers.size(), oldest->items.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    EXPECT_EQ(numbers[i],
              std::pair(oldest->items[i].rig, oldest->items[i].event));
  }
  const auto of_b = store_->ListNewestEvents({}, "b");
  ASSERT_TRUE(of_b.ok());
  ASSERT_FALSE(of_b->items.empty());
  for (const StoredEvent& event : of_b->items) EXPECT_EQ(event.rig, "b");
}

}  // namespace
}  // namespace selfcal::server
