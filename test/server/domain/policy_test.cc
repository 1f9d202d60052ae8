// What of a rig goes by the clock: ages of tables and calibrations, and runs
// that are deferred.
#include <random>

#include "server/domain/clock.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kSecond = 1'000'000'000;

class PolicyTest : public StoreTest {
 protected:
  Rig Create(const RigPolicy& policy, int table_size = 2) {
    Rig rig = TestRig("a");
    rig.table_size = table_size;
    EXPECT_TRUE(domain_->CreateRig(rig, policy).ok());
    return rig;
  }

  // Puts and scores a segment at that time.
  ScoreCommit Arrive(const Rig& rig,
                     std::int64_t index,
                     double entropy,
                     std::int64_t time_s) {
    now_ns_ = time_s * kSecond;
    Put("a", index);
    return Score(rig, index, entropy);
  }

  StoredCalibration Found(const Rig& rig) const {
    StoredCalibration found;
    found.theta = rig.factory;
    const int size = TangentSize(rig.factory);
    found.covariance = Eigen::MatrixXd::Identity(size, size);
    return found;
  }
};
SELFCAL_STORE_TEST_SUITE(PolicyTest);

TEST_P(PolicyTest, ComesBackAsItWasGiven) {
  const RigPolicy policy{1, 2 * kSecond + 5, 3 * kSecond, {}};
  Create(policy);
  CreateTestRig("b");
  Reopen();
  EXPECT_EQ(store_->GetRig("a")->policy, policy);
  EXPECT_EQ(store_->GetRig("b")->policy, RigPolicy());
}

// Against the tables as values, with arrivals at random times.
TEST_P(PolicyTest, TablesHoldTheBestOfThoseThatAreYoungEnough) {
  constexpr std::int64_t kMaxAge = 10;  // [s]
  RigPolicy policy;
  policy.table_max_age_ns = kMaxAge * kSecond;
  const Rig rig = Create(policy, 3);
  std::mt19937 random(7);
  std::vector<Table> expected = MakeTables(rig);
  std::vector<std::int64_t> times;
  std::int64_t time = 1000;
  int expired = 0;
  for (int k = 0; k < 60; ++k) {
    time += std::uniform_int_distribution<int>(0, 6)(random);
    times.push_back(time);
    const double entropy = std::uniform_int_distribution<int>(0, 9)(random);
    Arrive(rig, k, entropy, time);
    for (Table& table : expected) {
      expired += static_cast<int>(
          std::erase_if(table.entries, [&](const TableEntry& entry) {
            return times[entry.key.index] < time - kMaxAge;
          }));
      Offer({{"s", k}, k + 1, entropy, 5.0}, rig.min_gain_nats, &table);
    }
    const auto tables = store_->GetTables("a");
    ASSERT_TRUE(tables.ok());
    for (std::size_t t = 0; t < expected.size(); ++t) {
      ASSERT_EQ((*tables)[t].entries, expected[t].entries) << k;
    }
  }
  EXPECT_GT(expired, 20);
}

TEST_P(PolicyTest, RunByHandTakesNoSegmentThatIsTooOld) {
  RigPolicy policy;
  policy.table_max_age_ns = 3600 * kSecond;
  const Rig rig = Create(policy, 4);
  const std::int64_t now_s = NowNs() / kSecond;
  Arrive(rig, 0, 1, now_s - 3500);
  Arrive(rig, 1, 2, now_s);
  now_ns_ += 200 * kSecond;
  const auto run = domain_->CreateManualRun("a");
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_THAT(run->segments, ElementsAre(SegmentKey{"s", 1}));
}

TEST_P(PolicyTest, OldCalibrationStartsOneRunOnNewSegments) {
  RigPolicy policy;
  policy.calibration_max_age_ns = 100 * kSecond;
  Rig rig = TestRig("a");
  rig.table_size = 4;
  ASSERT_TRUE(domain_->CreateRig(rig, policy).ok());
  const std::int64_t later = NowNs() + 1000 * kSecond;
  for (int k = 0; k < 4; ++k) {
    Put("a", k);
    Score(rig, k, 10 + k);
  }
  // While the run is unfinished, and before the calibration came from a run.
  EXPECT_THAT(*domain_->StartTimedRuns(later), IsEmpty());
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, Found(rig)).ok());
  // Nothing new.
  EXPECT_THAT(*domain_->StartTimedRuns(later), IsEmpty());
  Put("a", 4);
  Score(rig, 4, 1);
  // Not old.
  EXPECT_THAT(*domain_->StartTimedRuns(NowNs()), IsEmpty());
  const auto started = domain_->StartTimedRuns(later);
  ASSERT_TRUE(started.ok()) << started.status();
  ASSERT_EQ(started->size(), 1u);
  EXPECT_EQ(started->front().trigger, RunTrigger::kCalibrationAged);
  Reopen();
  EXPECT_EQ(store_->GetRun("a", 2)->trigger, RunTrigger::kCalibrationAged);
  EXPECT_THAT(*domain_->StartTimedRuns(later), IsEmpty());
  // A failure is not repeated before as much time has passed again.
  ASSERT_TRUE(domain_->EndRun("a", 2, RunState::kFailed, "broke").ok());
  Put("a", 5);
  Score(rig, 5, 0);
  EXPECT_THAT(*domain_->StartTimedRuns(NowNs() + 50 * kSecond), IsEmpty());
  EXPECT_EQ(domain_->StartTimedRuns(later)->size(), 1u);
}

TEST_P(PolicyTest, DeferredRunSaysWhyAndIsLoggedOnce) {
  const Rig rig = Create({});
  Put("a", 0);
  Score(rig, 0, 1);
  ASSERT_TRUE(domain_->CreateManualRun("a").ok());
  ASSERT_TRUE(domain_->DeferRun("a", 1, "on battery").ok());
  ASSERT_TRUE(domain_->DeferRun("a", 1, "on battery").ok());
  ASSERT_TRUE(domain_->DeferRun("a", 1, "the load is high").ok());
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kPending);
  EXPECT_EQ(store_->GetRun("a", 1)->message, "the load is high");
  int held = 0;
  const auto events = store_->ListEvents({1000, ""});
  for (const StoredEvent& event : events->items) {
    if (event.kind != EventKind::kRunDeferred) continue;
    ++held;
    EXPECT_THAT(event.detail, HasSubstr("on battery"));
  }
  EXPECT_EQ(held, 1);
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  EXPECT_EQ(store_->GetRun("a", 1)->message, "");
  EXPECT_TRUE(absl::IsFailedPrecondition(domain_->DeferRun("a", 1, "late")));
}

}  // namespace
}  // namespace selfcal::server
