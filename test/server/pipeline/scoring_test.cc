#include <map>
#include <mutex>
#include <random>
#include <set>
#include <stdexcept>

#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/sqlite/tamper.h"

namespace selfcal::server {
namespace {

class ScoringTest : public PipelineTest {
 protected:
  void DamageData(std::int64_t index) {
    store_.reset();
    ASSERT_TRUE(DamageSegmentData(folder_.File("selfcal.db"), index).ok());
    OpenStore();
  }
};

TEST_F(ScoringTest, WhatWasStoredBeforeTheStartIsScored) {
  CreateRig();
  CreateRig("b");
  for (int k = 0; k < 5; ++k) {
    ASSERT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
    ASSERT_TRUE(domain_->PutSegment("b", Segment(k)).ok());
  }
  OpenStore();
  StartOne();
  EXPECT_TRUE(AllScored());
  EXPECT_EQ((*store_->GetTables("a"))[0].scored, 5);
  EXPECT_EQ((*store_->GetTables("b"))[0].scored, 5);
}

TEST_F(ScoringTest, RigsTakeTurns) {
  CreateRig("busy");
  CreateRig("quiet");
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(domain_->PutSegment("busy", Segment(k)).ok());
  }
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(domain_->PutSegment("quiet", Segment(k)).ok());
  }
  std::mutex mutex;
  std::set<std::pair<std::string, std::int64_t>> seen;
  std::vector<std::string> order;  // of first scores: a run scores anew
  estimators_.score = [&](const Rig& rig, const auto&, const auto& segment) {
    const std::lock_guard lock(mutex);
    if (seen.emplace(rig.id, segment.key.index).second) order.push_back(rig.id);
    return FakeInformation(rig, EntropyOf(segment.key.index));
  };
  StartOne();
  ASSERT_TRUE(AllScored());
  pipeline_->Stop();
  ASSERT_EQ(order.size(), 23u);
  EXPECT_EQ(std::count(order.begin(), order.begin() + 6, "quiet"), 3);
}

TEST_F(ScoringTest, StopInTheMiddleLosesNothing) {
  CreateRig();
  options_.scoring_threads = 2;
  options_.max_backlog = 100;
  for (int round = 0; round < 6; ++round) {
    Restart();
    for (int k = 0; k < 4; ++k) Submit(4 * round + k);
  }
  Restart();
  EXPECT_TRUE(AllScored());
  EXPECT_EQ((*store_->GetTables("a"))[0].scored, 24);
}

TEST_F(ScoringTest, TablesAndRunsDoNotDependOnTheNumberOfThreads) {
  options_.max_backlog = 100;
  // The later ones are done first, if they may.
  estimators_.score = [](const Rig& rig, const auto&, const auto& segment) {
    std::this_thread::sleep_for(
        std::chrono::milliseconds((40 - segment.key.index) / 4));
    return FakeInformation(rig, static_cast<double>(segment.key.index % 3));
  };
  std::vector<std::vector<TableEntry>> results;
  for (const int threads : {1, 4}) {
    options_.scoring_threads = threads;
    const Rig rig = CreateRig("rig" + std::to_string(threads));
    StartOne();
    for (int k = 0; k < 40; ++k) Submit(k, rig.id);
    ASSERT_TRUE(AllScored());
    pipeline_->Stop();
    // Committed in order, the first two start the first run.
    EXPECT_THAT(store_->GetRun(rig.id, 1)->segments,
                ::testing::ElementsAre(SegmentKey{"s", 0}, SegmentKey{"s", 1}));
    const auto tables = store_->GetTables(rig.id);
    ASSERT_TRUE(tables.ok()) << tables.status();
    for (const Table& table : *tables) {
      results.push_back(table.entries);
    }
  }
  const std::size_t groups = results.size() / 2;
  for (std::size_t g = 0; g < groups; ++g) {
    EXPECT_EQ(results[g], results[g + groups]);
    EXPECT_EQ(results[g].size(), 2u);
  }
}

// Also that of a SLAM process which goes on with an old one.
TEST_F(ScoringTest, ScoreIsTakenAtTheVersionThatIsActive) {
  const Rig rig = CreateRig();
  std::atomic<double> used{0};
  estimators_.score = [&](const Rig& r, const Calibration& theta, const auto&) {
    used = theta.cameras[0].f.x();
    return FakeInformation(r, 1.0);
  };
  StartOne();
  Submit(0);
  Submit(1);  // fills the tables: version 2 comes
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(used, rig.factory.cameras[0].f.x());
  Submit(2);  // names version 1 still
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(used, rig.factory.cameras[0].f.x() + 0.5);
  pipeline_->Stop();  // a run may still score what it holds out
}

TEST_F(ScoringTest, DamagedSegmentDoesNotHoldUpTheOthers) {
  CreateRig();
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
  }
  DamageData(1);
  StartOne();
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->state, SegmentState::kScored);
  EXPECT_EQ(store_->GetSegment("a", {"s", 1})->state, SegmentState::kUnusable);
  EXPECT_EQ(store_->GetSegment("a", {"s", 2})->state, SegmentState::kScored);
  EXPECT_FALSE(store_->GetSegment("a", {"s", 1})->problem.empty());
}

TEST_F(ScoringTest, WhatScoringThrowsOrCannotCountSetsTheSegmentAside) {
  CreateRig();
  estimators_.score = [](const Rig& rig, const auto&, const auto& segment) {
    if (segment.key.index == 0) throw std::runtime_error("singular");
    SegmentInformation information = FakeInformation(rig, 1.0);
    if (segment.key.index == 1) {
      information.Lambda(0, 0) = std::numeric_limits<double>::quiet_NaN();
    }
    return information;
  };
  StartOne();
  for (int k = 0; k < 3; ++k) Submit(k);
  ASSERT_TRUE(AllScored());
  EXPECT_NE(store_->GetSegment("a", {"s", 0})->problem.find("singular"),
            std::string::npos);
  EXPECT_EQ(store_->GetSegment("a", {"s", 1})->state, SegmentState::kUnusable);
  EXPECT_EQ(store_->GetSegment("a", {"s", 2})->state, SegmentState::kScored);
}

}  // namespace
}  // namespace selfcal::server
