// Lists of versions and runs by state, verdict, temperature, trigger and
// duration, of one rig and of all.
#include <optional>
#include <string>
#include <vector>

#include "server/store/change_rows.h"
#include "server/store/driver/statement.h"
#include "server/store/runs.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class VersionListsTest : public StoreTest {
 protected:
  static constexpr std::int64_t kTime = 1'700'000'000'000'000'000;
  static constexpr std::int64_t kSecond = 1'000'000'000;

  // A rig with a segment, which states this temperature.
  void AddRig(const std::string& id, std::optional<double> temperature_c) {
    const Rig rig = CreateTestRig(id);
    MotionSegment segment = Segment(0);
    segment.temperature_c = temperature_c;
    ASSERT_TRUE(domain_->PutSegment(id, segment).ok());
    Score(rig, 0, 1.0);
    now_ns_ += kSecond;
  }

  std::int64_t BeginRun(const std::string& id) {
    const auto run = domain_->CreateManualRun(id, true);
    EXPECT_TRUE(run.ok()) << run.status();
    EXPECT_TRUE(domain_->BeginRun(id, run->run).ok());
    return run->run;
  }

  StoredCalibration Result(const std::string& id, std::int64_t run) {
    return TestCalibration(TestRig(id), *store_->GetRun(id, run));
  }

  void FinishRun(const std::string& id,
                 std::int64_t run,
                 VerdictKind verdict,
                 CalibrationState state = CalibrationState::kActive) {
    StoredCalibration result = Result(id, run);
    result.state = state;
    result.verdict.kind = verdict;
    const auto finished = domain_->FinishRun(id, run, result);
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  // A run of the rig that takes this long.
  void Run(const std::string& id,
           VerdictKind verdict,
           std::int64_t duration_s = 1) {
    const std::int64_t run = BeginRun(id);
    now_ns_ += duration_s * kSecond;
    FinishRun(id, run, verdict);
    now_ns_ += kSecond;
  }

  void ChangeDevice(const std::string& id) {
    StoredChange change;
    change.rig = id;
    change.change = 1;
    change.time_ns = now_ns_;
    change.base_version = 1;
    change.first_sequence = 1;
    const absl::Status inserted = store_->Transact(
        id, now_ns_, [&](UnitOfWork* tx) { return InsertChange(tx, change); });
    ASSERT_TRUE(inserted.ok()) << inserted;
  }

  // Page by page, as "a2".
  std::vector<std::string> Versions(const CalibrationQuery& query,
                                    const std::string& rig = "",
                                    const RigQuery& of = {}) {
    std::vector<std::string> all;
    Page page{2, ""};
    do {
      const auto listed = store_->ListCalibrations(rig, query, page, of);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      for (const StoredCalibration& version : listed->items) {
        all.push_back(version.rig + std::to_string(version.version));
      }
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }

  std::vector<std::string> Runs(const RunQuery& query,
                                const std::string& rig = "",
                                const RigQuery& of = {}) {
    std::vector<std::string> all;
    Page page{2, ""};
    do {
      const auto listed = store_->ListRuns(rig, query, page, of);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      for (const StoredRun& run : listed->items) {
        all.push_back(run.rig + std::to_string(run.run));
      }
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }

  std::vector<std::string> WithVerdict(VerdictKind kind) {
    CalibrationQuery query;
    query.verdict = kind;
    return Versions(query);
  }
};
SELFCAL_STORE_TEST_SUITE(VersionListsTest);

TEST_P(VersionListsTest, AVersionIsFoundByItsPresentVerdict) {
  now_ns_ = kTime;
  AddRig("a", std::nullopt);
  EXPECT_THAT(WithVerdict(VerdictKind::kFactory), ElementsAre("a1"));

  const std::int64_t first = BeginRun("a");
  StoredCalibration candidate = Result("a", first);
  candidate.state = CalibrationState::kCandidate;
  ASSERT_TRUE(domain_->StoreCandidate("a", first, candidate).ok());
  EXPECT_THAT(WithVerdict(VerdictKind::kUnknown), ElementsAre("a2"));

  FinishRun("a", first, VerdictKind::kGood);
  EXPECT_THAT(WithVerdict(VerdictKind::kUnknown), IsEmpty());
  EXPECT_THAT(WithVerdict(VerdictKind::kGood), ElementsAre("a2"));
  EXPECT_THAT(WithVerdict(VerdictKind::kFactory), ElementsAre("a1"));

  // A rejected version is not trustworthy, whatever its validation says.
  now_ns_ += kSecond;
  FinishRun(
      "a", BeginRun("a"), VerdictKind::kUnknown, CalibrationState::kRejected);
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy), ElementsAre("a3"));

  now_ns_ += kSecond;
  Run("a", VerdictKind::kWeak);
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), ElementsAre("a4"));
  ASSERT_TRUE(domain_->ReportDisagreement("a", 4, "by 3 sigma").ok());
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), IsEmpty());
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy),
              ElementsAre("a4", "a3"));
}

TEST_P(VersionListsTest, AChangeConcernsTheVersionWhileItIsActive) {
  now_ns_ = kTime;
  AddRig("a", std::nullopt);
  Run("a", VerdictKind::kGood);
  Run("a", VerdictKind::kWeak);
  ChangeDevice("a");
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy), ElementsAre("a3"));
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), IsEmpty());
  EXPECT_THAT(WithVerdict(VerdictKind::kGood), ElementsAre("a2"));

  ASSERT_TRUE(domain_->ActivateCalibration("a", 2, "eve", "trial").ok());
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy), ElementsAre("a2"));
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), ElementsAre("a3"));

  now_ns_ += kSecond;
  Run("a", VerdictKind::kGood);  // on segments since the change
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy), IsEmpty());
  EXPECT_THAT(WithVerdict(VerdictKind::kGood), ElementsAre("a4", "a2"));
}

// The run that finds a change ends at the time of the change, and its result
// accounts for it.
TEST_P(VersionListsTest, AVersionWhoseRunFoundTheChangeIsTrusted) {
  now_ns_ = kTime;
  AddRig("a", std::nullopt);
  const std::int64_t run = BeginRun("a");
  now_ns_ += kSecond;
  FinishRun("a", run, VerdictKind::kGood);
  ChangeDevice("a");
  EXPECT_EQ(store_->GetCalibration("a", 2)->changed_since, 0);
  EXPECT_THAT(WithVerdict(VerdictKind::kGood), ElementsAre("a2"));
  EXPECT_THAT(WithVerdict(VerdictKind::kNotTrustworthy), IsEmpty());
}

TEST_P(VersionListsTest, VersionsOfAllRigsAreFilteredAndSorted) {
  now_ns_ = kTime;
  AddRig("a", 20.5);
  AddRig("b", 30.25);
  AddRig("c", std::nullopt);
  now_ns_ = kTime + 10 * kSecond;
  Run("b", VerdictKind::kGood);
  Run("a", VerdictKind::kGood);
  Run("c", VerdictKind::kGood);
  Run("a", VerdictKind::kWeak);

  CalibrationQuery query;
  query.state = CalibrationState::kActive;
  EXPECT_THAT(Versions(query), ElementsAre("a3", "c2", "b2"));
  query.descending = false;
  EXPECT_THAT(Versions(query), ElementsAre("b2", "c2", "a3"));
  query.verdict = VerdictKind::kGood;
  EXPECT_THAT(Versions(query), ElementsAre("b2", "c2"));

  query = {};
  query.create_time_ns = {kTime + 5 * kSecond, kTime + 14 * kSecond};
  EXPECT_THAT(Versions(query), ElementsAre("a2", "b2"));
  query.create_time_ns.least = std::nullopt;
  EXPECT_THAT(Versions(query), ElementsAre("a2", "b2", "c1", "b1", "a1"));

  query = {};
  query.order = CalibrationQuery::Order::kTemperature;
  EXPECT_THAT(Versions(query), ElementsAre("b2", "a3", "a2"));
  query.descending = false;
  EXPECT_THAT(Versions(query), ElementsAre("a2", "a3", "b2"));
  query.temperature_c.least = 20.5;
  EXPECT_THAT(Versions(query), ElementsAre("a2", "a3", "b2"));
  query.temperature_c.most = 30.0;
  EXPECT_THAT(Versions(query), ElementsAre("a2", "a3"));
  query.order = CalibrationQuery::Order::kCreation;
  EXPECT_THAT(Versions(query), ElementsAre("a2", "a3"));

  RigQuery of;
  of.text = "b";
  EXPECT_THAT(Versions(query, "", of), IsEmpty());
  query.temperature_c = {};
  EXPECT_THAT(Versions(query, "", of), ElementsAre("b1", "b2"));
}

TEST_P(VersionListsTest, VersionsOfARigAreFilteredAndSorted) {
  now_ns_ = kTime;
  AddRig("a", 20.5);
  AddRig("b", 10.0);
  Run("a", VerdictKind::kGood);
  Run("a", VerdictKind::kWeak);
  Run("a", VerdictKind::kGood);
  CalibrationQuery query;
  query.descending = false;
  EXPECT_THAT(Versions(query, "a"), ElementsAre("a1", "a2", "a3", "a4"));
  query.verdict = VerdictKind::kGood;
  EXPECT_THAT(Versions(query, "a"), ElementsAre("a2", "a4"));
  query = {};
  query.order = CalibrationQuery::Order::kTemperature;
  EXPECT_THAT(Versions(query, "a"), ElementsAre("a4", "a3", "a2"));
  EXPECT_TRUE(
      absl::IsNotFound(store_->ListCalibrations("nobody", query, {}).status()));
}

// Several temperatures, whose mean a version shows to the last bit.
TEST_P(VersionListsTest, TheTemperatureIsTheMeanThatIsShown) {
  const Rig rig = CreateTestRig("a");
  for (int k = 0; k < 3; ++k) {
    MotionSegment segment = Segment(k);
    segment.temperature_c = 20.1 + 0.7 * k;
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
    Score(rig, k, 1.0 + k);
  }
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());  // full tables created it
  FinishRun("a", 1, VerdictKind::kGood);
  const auto version = store_->GetCalibration("a", 2);
  ASSERT_TRUE(version.ok()) << version.status();
  ASSERT_TRUE(version->temperatures.has_value());
  CalibrationQuery query;
  query.temperature_c = {version->temperatures->mean_c,
                         version->temperatures->mean_c};
  EXPECT_THAT(Versions(query), ElementsAre("a2"));
}

TEST_P(VersionListsTest, RunsAreFilteredAndSorted) {
  now_ns_ = kTime;
  for (const std::string id : {"a", "b"}) AddRig(id, std::nullopt);
  Run("a", VerdictKind::kGood, 5);
  Run("b", VerdictKind::kGood, 60);
  Run("a", VerdictKind::kGood, 7);
  const std::int64_t failing = BeginRun("b");
  now_ns_ += 20 * kSecond;
  ASSERT_TRUE(
      domain_->EndRun("b", failing, RunState::kFailed, "the solver failed")
          .ok());
  now_ns_ += kSecond;
  BeginRun("a");

  RunQuery query;
  query.state = RunState::kFailed;
  EXPECT_THAT(Runs(query), ElementsAre("b2"));
  EXPECT_THAT(Runs(query, "a"), IsEmpty());
  query.state = RunState::kSucceeded;
  EXPECT_THAT(Runs(query), ElementsAre("a2", "b1", "a1"));
  query.create_time_ns.least = kTime + 5 * kSecond;
  EXPECT_THAT(Runs(query), ElementsAre("a2", "b1"));
  EXPECT_THAT(Runs(query, "a"), ElementsAre("a2"));

  query = {};
  query.order = RunQuery::Order::kDuration;
  EXPECT_THAT(Runs(query), ElementsAre("b1", "b2", "a2", "a1"));
  query.descending = false;
  EXPECT_THAT(Runs(query), ElementsAre("a1", "a2", "b2", "b1"));
  EXPECT_THAT(Runs(query, "b"), ElementsAre("b2", "b1"));
  query.state = RunState::kSucceeded;
  EXPECT_THAT(Runs(query), ElementsAre("a1", "a2", "b1"));
}

TEST_P(VersionListsTest, RunsAreFoundByEachTrigger) {
  constexpr RunTrigger kTriggers[] = {RunTrigger::kTablesFull,
                                      RunTrigger::kTablesChanged,
                                      RunTrigger::kManual,
                                      RunTrigger::kChangeDetected,
                                      RunTrigger::kCalibrationAged,
                                      RunTrigger::kSessionEnded};
  for (const RunTrigger trigger : kTriggers) {
    const std::string id = "r" + std::to_string(static_cast<int>(trigger));
    CreateTestRig(id);
    StoredRun run;
    run.rig = id;
    run.run = 1;
    run.trigger = trigger;
    run.change = trigger == RunTrigger::kChangeDetected ? 1 : 0;
    run.base_version = 1;
    const absl::Status inserted = store_->Transact(
        id, 1, [&](UnitOfWork* tx) { return InsertRun(tx, run); });
    ASSERT_TRUE(inserted.ok()) << inserted;
  }
  for (const RunTrigger trigger : kTriggers) {
    RunQuery query;
    query.trigger = trigger;
    EXPECT_THAT(
        Runs(query),
        ElementsAre("r" + std::to_string(static_cast<int>(trigger)) + "1"));
    const auto listed = store_->ListRuns("", query, {});
    ASSERT_TRUE(listed.ok()) << listed.status();
    EXPECT_EQ(listed->items.front().trigger, trigger);
  }
}

TEST_P(VersionListsTest, ATokenIsOfItsQuery) {
  now_ns_ = kTime;
  AddRig("a", 20.0);
  AddRig("b", 21.0);
  Run("a", VerdictKind::kGood);
  Run("b", VerdictKind::kGood);
  CalibrationQuery good;
  good.verdict = VerdictKind::kGood;
  CalibrationQuery warm;
  warm.order = CalibrationQuery::Order::kTemperature;
  const auto listed = store_->ListCalibrations("", good, {1, ""});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_FALSE(listed->next_token.empty());
  const Page next{1, listed->next_token};
  EXPECT_TRUE(store_->ListCalibrations("", good, next).ok());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCalibrations("", warm, next).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListCalibrations("", next).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCalibrations("a", good, next).status()));
  RunQuery slow;
  slow.order = RunQuery::Order::kDuration;
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListRuns("", slow, next).status()));
}

TEST_P(VersionListsTest, ASummaryHasAllButTheDetails) {
  now_ns_ = kTime;
  AddRig("a", 20.0);
  const std::int64_t run = BeginRun("a");
  StoredCalibration result = Result("a", run);
  result.settings = {{"seed", "7"}};
  result.report = CalibrationResult();
  result.report->final_cost = 10;
  result.report->segment_fits.resize(2);
  result.report->covariance_of_data = result.covariance;
  result.steps.resize(1);
  result.steps[0].theta = result.theta;
  result.verdict = {VerdictKind::kGood, {"noted"}};
  ASSERT_TRUE(domain_->FinishRun("a", run, result).ok());
  const auto all = store_->ListCalibrations("a", {});
  const auto summaries =
      store_->ListCalibrations("a", {}, {}, {}, CalibrationParts::kSummary);
  ASSERT_TRUE(all.ok()) << all.status();
  ASSERT_TRUE(summaries.ok()) << summaries.status();
  ASSERT_EQ(summaries->items.size(), 2u);
  const StoredCalibration& full = all->items.front();
  const StoredCalibration& summary = summaries->items.front();
  ASSERT_TRUE(full.report && summary.report);
  EXPECT_GT(full.covariance.size(), 0);
  EXPECT_EQ(full.report->segment_fits.size(), 2u);
  EXPECT_EQ(full.settings, result.settings);
  ExpectSameCalibration(summary.theta, full.theta);
  EXPECT_EQ(summary.report->final_cost, full.report->final_cost);
  EXPECT_EQ(summary.verdict.kind, full.verdict.kind);
  EXPECT_EQ(summary.verdict.sentences, full.verdict.sentences);
  EXPECT_EQ(summary.segments, full.segments);
  EXPECT_EQ(summary.temperatures->mean_c, full.temperatures->mean_c);
  EXPECT_EQ(summary.program_version, full.program_version);
  EXPECT_EQ(summary.covariance.size(), 0);
  EXPECT_TRUE(summary.settings.empty());
  EXPECT_TRUE(summary.report->segment_fits.empty());
}

// The records are those of an earlier program.
TEST_P(VersionListsTest, VersionsAreCompletedLater) {
  now_ns_ = kTime;
  AddRig("a", 20.0);
  Run("a", VerdictKind::kWeak);
  const absl::Status cleared =
      store_->Transact("a", now_ns_, [](UnitOfWork* tx) {
        return Statement(tx->db(),
                         "UPDATE calibrations SET validated = NULL, "
                         "  temperature_c = NULL WHERE rig = ?1",
                         tx->rig_row())
            .Run();
      });
  ASSERT_TRUE(cleared.ok()) << cleared;
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), IsEmpty());
  EXPECT_THAT(WithVerdict(VerdictKind::kFactory), ElementsAre("a1"));
  for (const int expected : {1, 1, 0}) {
    const auto written = domain_->CompleteVersions(1);
    ASSERT_TRUE(written.ok()) << written.status();
    EXPECT_EQ(*written, expected);
  }
  EXPECT_THAT(WithVerdict(VerdictKind::kWeak), ElementsAre("a2"));
  CalibrationQuery warm;
  warm.order = CalibrationQuery::Order::kTemperature;
  EXPECT_THAT(Versions(warm), ElementsAre("a2"));
}

}  // namespace
}  // namespace selfcal::server
