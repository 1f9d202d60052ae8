// Duplicate, reordered and interrupted streams come to the same database.
#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "test/promise.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

constexpr int kOrderedSegments = 12;

class StreamOrderTest : public PipelineTest {
 protected:
  // What the tables of a rig hold, by group and segment.
  using Content = std::map<std::string, std::map<std::int64_t, double>>;

  void Create(const std::string& id) {
    Rig rig = TestRig(id);
    rig.table_size = 4;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
  }

  Content TablesOf(const std::string& rig) {
    Content content;
    const auto tables = store_->GetTables(rig);
    EXPECT_TRUE(tables.ok());
    for (const Table& table : *tables) {
      EXPECT_EQ(table.scored, kOrderedSegments) << table.group;
      for (const TableEntry& entry : table.entries) {
        content[table.group][entry.key.index] = entry.entropy;
      }
    }
    return content;
  }
};

TEST_F(StreamOrderTest, TheSameSegmentsGiveTheSameTables) {
  Promise promise("the same segment twice changes nothing");
  std::mt19937 random(1);
  StartOne();
  Create("once");
  for (int k = 0; k < kOrderedSegments; ++k) {
    ASSERT_EQ(Submit(k, "once"), SubmitResult::Verdict::kStored);
  }
  ASSERT_TRUE(AllScored());
  const Content once = TablesOf("once");
  ASSERT_FALSE(once.empty());
  for (int trials = Trials(5); promise.trials < trials; ++promise.trials) {
    const std::string rig = "r" + std::to_string(promise.trials);
    Create(rig);
    std::vector<int> order;
    for (int k = 0; k < 3 * kOrderedSegments; ++k)
      order.push_back(k % kOrderedSegments);
    std::shuffle(order.begin(), order.end(), random);
    std::set<int> sent;
    for (const int k : order) {
      const auto expected = sent.insert(k).second
                                ? SubmitResult::Verdict::kStored
                                : SubmitResult::Verdict::kDuplicate;
      promise.lost += Submit(k, rig) == expected ? 0 : 1;
      if (random() % 8 == 0) Restart();
    }
    ASSERT_TRUE(AllScored());
    promise.lost += TablesOf(rig) == once ? 0 : 1;
  }
}

}  // namespace
}  // namespace selfcal::server
