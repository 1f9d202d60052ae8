// Alarms that are stored with a rig are those of its records, after anything.
#include "server/domain/alarms.h"

#include <random>

#include "server/store/outbox.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class AlarmsTest : public StoreTest {
 protected:
  void FillRig(const std::string& id) {
    const Rig rig = CreateTestRig(id);
    Put(id, 0);
    Score(rig, 0, 1.0);
  }

  // A run with this end; if it succeeds, its version gets this state.
  void Run(const std::string& id,
           RunState end,
           CalibrationState state = CalibrationState::kRejected) {
    const auto run = domain_->CreateManualRun(id, true);
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_TRUE(domain_->BeginRun(id, run->run).ok());
    if (end != RunState::kSucceeded) {
      ASSERT_TRUE(domain_->EndRun(id, run->run, end, "why").ok());
      return;
    }
    StoredCalibration result =
        TestCalibration(TestRig(id), *store_->GetRun(id, run->run));
    result.state = state;
    result.reasons = {"a trial"};
    const auto finished = domain_->FinishRun(id, run->run, result);
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  std::vector<std::string> WithAlarms() {
    RigQuery query;
    query.order = RigQuery::Order::kAlarms;
    query.descending = true;
    query.with_alarms = true;
    std::vector<std::string> names;
    Page page{1, ""};
    do {
      const auto listed = store_->ListRigSummaries(query, page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return names;
      for (const RigSummary& rig : listed->items) names.push_back(rig.rig);
      page.token = listed->next_token;
    } while (!page.token.empty());
    return names;
  }

  // Of the summaries of all rigs.
  std::vector<std::string> Expected() {
    std::vector<std::string> names;
    const auto listed = store_->ListRigSummaries({}, {100, ""});
    EXPECT_TRUE(listed.ok()) << listed.status();
    for (const RigSummary& rig : listed->items) {
      if (!AlarmsOf(rig, NowNs()).empty()) names.push_back(rig.rig);
    }
    return names;
  }
};
SELFCAL_STORE_TEST_SUITE(AlarmsTest);

TEST_P(AlarmsTest, TheMostUrgentComeFirstAndOthersAreNotListed) {
  for (const char* id : {"failed", "fine", "rejected"}) FillRig(id);
  EXPECT_THAT(WithAlarms(), IsEmpty());
  Run("failed", RunState::kFailed);
  Run("rejected", RunState::kSucceeded, CalibrationState::kRejected);
  Run("fine", RunState::kSucceeded, CalibrationState::kActive);
  EXPECT_THAT(WithAlarms(), ElementsAre("rejected", "failed"));
  Run("rejected", RunState::kSucceeded, CalibrationState::kActive);
  EXPECT_THAT(WithAlarms(), ElementsAre("failed"));
  Run("failed", RunState::kCancelled);
  EXPECT_THAT(WithAlarms(), IsEmpty());
}

TEST_P(AlarmsTest, ATableThatDoesNotFillIsOne) {
  const Rig rig = CreateTestRig("a");
  for (int k = 0; k < 10 * rig.table_size; ++k) {
    EXPECT_THAT(WithAlarms(), IsEmpty());
    Put("a", k);
    Score(rig, k, 99, 0.0);
  }
  EXPECT_THAT(WithAlarms(), ElementsAre("a"));
}

TEST_P(AlarmsTest, ADeviceThatIsSilentForADayIsOneUntilItReports) {
  Rig rig = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  ASSERT_TRUE(store_->outbox()->BeginAnew("a", ReportedData::kNone).ok());
  const auto report =
      store_->outbox()->Next(store_->outbox()->List()->front(), 1 << 20);
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_TRUE(domain_->DeleteRig("a", "eve", "to be reported").ok());
  const std::int64_t then = NowNs();
  now_ns_ = then;
  DeviceReport again;
  again.rig = "a";
  again.key = report->key;
  again.number = 1;
  again.records = report->records;
  ASSERT_TRUE(domain_->TakeReport(again).ok());
  now_ns_ = then + kSilentAfterNs - 1;
  ASSERT_TRUE(domain_->NoteSilentDevices().ok());
  EXPECT_THAT(WithAlarms(), IsEmpty());
  now_ns_ = then + kSilentAfterNs + 1;
  ASSERT_TRUE(domain_->NoteSilentDevices().ok());
  EXPECT_THAT(WithAlarms(), ElementsAre("a"));
  ASSERT_TRUE(domain_->TakeReport(again).ok());
  EXPECT_THAT(WithAlarms(), IsEmpty());
}

TEST_P(AlarmsTest, AreThoseOfTheRecordsAfterAnything) {
  std::mt19937 random(5);
  const auto draw = [&](int n) {
    return std::uniform_int_distribution<int>(0, n - 1)(random);
  };
  const std::vector<std::string> rigs = {"a", "b", "c", "d"};
  std::vector<int> next(rigs.size(), 0);
  for (const std::string& id : rigs) CreateTestRig(id);
  int with_alarms = 0;
  for (int step = 0; step < 200; ++step) {
    const int which = draw(static_cast<int>(rigs.size()));
    const std::string& id = rigs[which];
    switch (draw(6)) {
      case 0:
      case 1:
      case 2:
        Put(id, next[which]);
        Score(TestRig(id), next[which], draw(9), draw(2) == 0 ? 5.0 : 0.0);
        ++next[which];
        break;
      case 3: {
        domain_->CreateManualRun(id, true).IgnoreError();
        const auto unfinished = store_->ListUnfinishedRuns();
        for (const StoredRun& run : *unfinished) {
          if (run.rig != id) continue;
          ASSERT_TRUE(domain_->BeginRun(id, run.run).ok());
          if (draw(2) == 0) {
            ASSERT_TRUE(
                domain_->EndRun(id, run.run, RunState::kFailed, "why").ok());
            continue;
          }
          StoredCalibration result =
              TestCalibration(TestRig(id), *store_->GetRun(id, run.run));
          if (draw(2) == 0) result.state = CalibrationState::kRejected;
          ASSERT_TRUE(domain_->FinishRun(id, run.run, result).ok());
        }
        break;
      }
      case 4:
        domain_->ActivateCalibration(id, 1 + draw(3), "eve", "x").IgnoreError();
        break;
      default:
        domain_->QuarantineSegments(id, "s", draw(9), "eve", "x").IgnoreError();
        break;
    }
    const auto expected = Expected();
    ASSERT_THAT(WithAlarms(), ::testing::UnorderedElementsAreArray(expected));
    with_alarms += static_cast<int>(expected.size());
  }
  EXPECT_GT(with_alarms, 50);
}

}  // namespace
}  // namespace selfcal::server
