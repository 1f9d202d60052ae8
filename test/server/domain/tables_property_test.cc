// Against a model: the best of everything scored so far, sorted from scratch.
#include <algorithm>
#include <random>

#include "test/promise.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using TablesPropertyTest = StoreTest;
SELFCAL_STORE_TEST_SUITE(TablesPropertyTest);

std::vector<TableEntry> BestOf(std::vector<TableEntry> all,
                               double min_gain,
                               int capacity) {
  std::erase_if(all, [&](const auto& entry) { return entry.gain < min_gain; });
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.entropy < b.entropy;
  });
  if (static_cast<int>(all.size()) > capacity) all.resize(capacity);
  return all;
}

TEST_P(TablesPropertyTest, TablesHoldTheBestAndTheirDataAlways) {
  std::mt19937 random(5);
  // Few values, so that ties happen.
  std::uniform_int_distribution<int> level(0, 9);
  Promise promise("tables hold exactly the N best");
  const int rigs = Trials(4);
  for (int trial = 0; trial < rigs; ++trial) {
    Rig rig = TestRig("rig" + std::to_string(trial));
    rig.table_size = 1 + trial % 8;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    std::vector<std::vector<TableEntry>> offered(rig.groups.size());
    std::vector<bool> kept;  // what is dropped never comes back
    for (int k = 0; k < 30; ++k) {
      Put(rig.id, k);
      SegmentInformation information = FakeInformation(rig, 0);
      for (std::size_t g = 0; g < rig.groups.size(); ++g) {
        information.groups[g].entropy = level(random);
        information.groups[g].gain = level(random) / 3.0;
        offered[g].push_back({{"s", k},
                              k + 1,
                              information.groups[g].entropy,
                              information.groups[g].gain});
      }
      const auto commit = domain_->CommitScore(rig.id, {"s", k}, information);
      ASSERT_TRUE(commit.ok()) << commit.status();
      if (commit->started_run) {
        ASSERT_TRUE(
            domain_
                ->EndRun(
                    rig.id, commit->started_run->run, RunState::kCancelled, "")
                .ok());
      }
      if (k % 7 == 3) Reopen();
      const auto tables = store_->GetTables(rig.id);
      ASSERT_TRUE(tables.ok());
      std::vector<bool> referenced(k + 1, false);
      for (std::size_t g = 0; g < rig.groups.size(); ++g) {
        const auto best = BestOf(offered[g], rig.min_gain_nats, rig.table_size);
        ASSERT_EQ((*tables)[g].entries, best) << "after " << k;
        ASSERT_EQ((*tables)[g].scored, k + 1);
        for (const TableEntry& entry : best) {
          referenced[entry.key.index] = true;
        }
      }
      const auto segments = store_->ListSegments(rig.id, {1000, ""});
      ASSERT_TRUE(segments.ok());
      kept.push_back(true);
      int reserve = kReserve;
      for (int index = k; index >= 0; --index) {
        if (referenced[index] || !kept[index]) continue;
        kept[index] = reserve > 0;
        --reserve;
      }
      for (const StoredSegment& segment : segments->items) {
        ASSERT_EQ(segment.has_data, kept[segment.key.index])
            << segment.key.index << " after " << k;
      }
      ++promise.trials;
    }
  }
}

}  // namespace
}  // namespace selfcal::server
