#include "server/metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>

#include "server/domain/clock.h"
#include "server/domain/domain.h"
#include "server/store/change_rows.h"
#include "server/store/reporting_device.h"
#include "test/server/http_get.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_records.h"
#include "test/server/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Verdict = PipelineObserver::Verdict;

class MetricsTest : public ::testing::Test {
 protected:
  MetricsTest() {
    store_ = *OpenSqliteStore(folder_.File("test.db"));
    domain_.emplace(store_.get());
    MetricsOptions options;
    options.address = "127.0.0.1:0";
    options.rigs = 2;
    options.program_version = "1.2.3";
    options.database = folder_.File("test.db");
    auto metrics = MakeMetrics(store_.get(), options);
    if (!metrics.ok()) throw std::runtime_error(metrics.status().ToString());
    metrics_ = std::move(*metrics);
  }

  std::string Scrape() { return HttpGet(metrics_->url()); }

  TempFolder folder_;
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
  std::unique_ptr<Metrics> metrics_;
};

TEST_F(MetricsTest, SeriesAreThereBeforeTheFirstEvent) {
  const std::string series = Scrape();
  for (const std::string line : {"selfcal_build_info{version=\"1.2.3\"} 1",
                                 "selfcal_segments_total{verdict=\"stored\"} 0",
                                 "selfcal_runs_total{outcome=\"activated\"} 0",
                                 "selfcal_verdicts_total{verdict=\"weak\"} 0",
                                 ("selfcal_checks_total{outcome=\"differs\","
                                  "subject=\"calibration\"} 0"),
                                 "selfcal_queue_length 0",
                                 "selfcal_database_bytes{file=\"database\"} ",
                                 "selfcal_disk_free_bytes ",
                                 "process_resident_memory_bytes "}) {
    EXPECT_THAT(series, HasSubstr(line));
  }
}

TEST_F(MetricsTest, AnotherNameThanThatOfTheLoopbackIsRefused) {
  EXPECT_THAT(HttpGet(metrics_->url(), "127.0.0.1:9464"),
              HasSubstr("selfcal_build_info"));
  for (const char* host : {"evil.example", "[::1].evil.example", ""}) {
    EXPECT_THAT(HttpGet(metrics_->url(), host),
                Not(HasSubstr("selfcal_build_info")))
        << host;
  }
}

TEST_F(MetricsTest, OtherPathsAreErrorsThatNameTheRightOne) {
  const std::string root = metrics_->url().substr(
      0, metrics_->url().size() - std::string("/metrics").size());
  for (const char* path : {"/", "/metric", "/metrics/", "/%00", "/../etc"}) {
    EXPECT_THAT(HttpGet(root + path), HasSubstr("the metrics are at /metrics"))
        << path;
  }
  EXPECT_THAT(Scrape(), HasSubstr("selfcal_build_info"));
}

TEST_F(MetricsTest, EventsAreCounted) {
  PipelineObserver* const observer = metrics_->observer();
  const Rig rig = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto segments = TestSegments(rig, 2);
  ASSERT_TRUE(domain_->PutSegment("a", segments[0]).ok());
  observer->OnVerdict("a", Verdict::kStored);
  observer->OnVerdict("a", Verdict::kStored);
  observer->OnVerdict("a", Verdict::kRejected);
  observer->OnScore(FakeInformation(rig, -12), 0.002);
  StoredRun run;
  run.rig = "a";
  run.run = 1;
  run.state = RunState::kRunning;
  observer->OnRun(run);
  observer->OnRun(run);
  run.state = RunState::kFailed;
  observer->OnRun(run);
  const std::string series = Scrape();
  for (const std::string line :
       {"selfcal_segments_total{verdict=\"stored\"} 2",
        "selfcal_segments_total{verdict=\"rejected\"} 1",
        "selfcal_scoring_seconds_bucket{le=\"0.003\"} 1",
        "selfcal_segment_entropy_nats_count{group=\"camera\"} 1",
        "selfcal_runs_total{outcome=\"failed\"} 1",
        "selfcal_run_seconds_count 1",
        "selfcal_queue_length 1",
        "selfcal_table_entries{rig=\"a\",group=\"imu\"} 0",
        "selfcal_table_capacity{rig=\"a\",group=\"imu\"} 2",
        "selfcal_active_version{rig=\"a\"} 1",
        "selfcal_active_verdict{rig=\"a\",verdict=\"factory\"} 1"}) {
    EXPECT_THAT(series, HasSubstr(line));
  }
}

// The value of a series, or -1.
double ValueOf(const std::string& series, const std::string& name) {
  const std::size_t at = series.find("\n" + name + " ");
  return at == series.npos ? -1
                           : std::stod(series.substr(at + name.size() + 2));
}

TEST_F(MetricsTest, VersionsAreCountedByVerdict) {
  const Rig rig = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  for (const MotionSegment& segment : TestSegments(rig, 2)) {
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
    ASSERT_TRUE(
        domain_->CommitScore("a", segment.key, FakeInformation(rig, -12)).ok());
  }
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  StoredCalibration result = TestCalibration(rig, *store_->GetRun("a", 1));
  result.verdict.kind = VerdictKind::kWeak;
  ASSERT_TRUE(domain_->FinishRun("a", 1, result).ok());
  metrics_->observer()->OnRun(*store_->GetRun("a", 1));
  const std::string series = Scrape();
  EXPECT_THAT(series, HasSubstr("selfcal_verdicts_total{verdict=\"weak\"} 1"));
  EXPECT_THAT(series, HasSubstr("selfcal_verdicts_total{verdict=\"good\"} 0"));
  EXPECT_THAT(series, HasSubstr("selfcal_runs_total{outcome=\"activated\"} 1"));
}

TEST_F(MetricsTest, TimesOfTheActiveVersionTheLastSegmentAndTheDeviceChange) {
  const double before = static_cast<double>(std::time(nullptr));
  const Rig rig = TestRig("a");
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  ASSERT_TRUE(domain_->PutSegment("a", TestSegments(rig, 1)[0]).ok());
  metrics_->observer()->OnVerdict("a", Verdict::kStored);
  const std::string active =
      "selfcal_active_since_timestamp_seconds{rig=\"a\"}";
  const std::string change =
      "selfcal_device_change_timestamp_seconds{rig=\"a\"}";
  const std::string segment =
      "selfcal_last_segment_timestamp_seconds{rig=\"a\"}";
  std::string series = Scrape();
  const double after = static_cast<double>(std::time(nullptr)) + 1;
  for (const std::string& name : {active, segment}) {
    EXPECT_GE(ValueOf(series, name), before) << name;
    EXPECT_LE(ValueOf(series, name), after) << name;
  }
  EXPECT_EQ(ValueOf(series, change), 0);
  constexpr std::int64_t kTime_ns = 1'700'000'000'500'000'000;
  StoredChange detected;
  detected.rig = "a";
  detected.change = 1;
  detected.time_ns = kTime_ns;
  detected.base_version = 1;
  detected.groups = {"extrinsics"};
  ASSERT_TRUE(
      store_
          ->Transact("a",
                     kTime_ns,
                     [&](UnitOfWork* tx) { return InsertChange(tx, detected); })
          .ok());
  EXPECT_EQ(ValueOf(Scrape(), change), 1'700'000'000.5);
}

TEST_F(MetricsTest, HubCountsTheRigsThatDevicesReport) {
  const std::string newest = "selfcal_hub_newest_report_timestamp_seconds";
  EXPECT_EQ(ValueOf(Scrape(), "selfcal_hub_rigs"), 0);
  EXPECT_EQ(ValueOf(Scrape(), newest), 0);
  constexpr std::int64_t kHour = std::int64_t{3600} * 1'000'000'000;
  constexpr std::int64_t kTime = 1'700'000'000'500'000'000;
  const auto report =
      [&](const std::string& rig, std::int64_t time_ns, std::int64_t waiting) {
        ASSERT_TRUE(domain_->CreateRig(TestRig(rig)).ok());
        const auto write = [&](UnitOfWork* tx) {
          return WriteReportingDevice(tx,
                                      {.key = 1,
                                       .report = 1,
                                       .attempt = 1,
                                       .time_ns = time_ns,
                                       .waiting = waiting,
                                       .program_version = "1.2.3"});
        };
        ASSERT_TRUE(store_->Transact(rig, time_ns, write).ok());
      };
  report("gone", kTime, 4);
  report("late", NowNs() - 25 * kHour, 2);
  report("slow", NowNs() - 23 * kHour, 1);
  const std::string series = Scrape();
  EXPECT_EQ(ValueOf(series, "selfcal_hub_rigs"), 3);
  EXPECT_EQ(ValueOf(series, "selfcal_hub_silent_rigs"), 2);
  EXPECT_EQ(ValueOf(series, "selfcal_hub_waiting_records"), 7);
  EXPECT_EQ(ValueOf(series, "selfcal_hub_oldest_report_timestamp_seconds"),
            1'700'000'000.5);
  EXPECT_GT(ValueOf(series, newest), 1'700'000'000.5);
}

TEST_F(MetricsTest, SeriesDoNotGrowWithTheRigs) {
  for (const std::string rig : {"a", "b", "c"}) {
    ASSERT_TRUE(domain_->CreateRig(TestRig(rig)).ok());
    metrics_->observer()->OnVerdict(rig, Verdict::kStored);
  }
  const std::string series = Scrape();
  EXPECT_THAT(series, Not(HasSubstr("rig=\"a\"")));
  EXPECT_THAT(series, HasSubstr("rig=\"b\""));
  EXPECT_THAT(series, HasSubstr("rig=\"c\""));
  EXPECT_THAT(series,
              HasSubstr("selfcal_segments_total{verdict=\"stored\"} 3"));
}

TEST(MetricsAddress, IsAPortOfTheLoopback) {
  for (const char* address : {"127.0.0.1:9464", "[::1]:1"}) {
    EXPECT_TRUE(CheckMetricsAddress(address).ok()) << address;
  }
  for (const char* address : {"",
                              "9464",
                              "0.0.0.0:9464",
                              "127.0.0.1",
                              "127.0.0.1:",
                              "127.0.0.1:70000",
                              "127.0.0.1:1,0.0.0.0:2",
                              "localhost:1",
                              "example.org:1"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckMetricsAddress(address)))
        << address;
  }
}

TEST_F(MetricsTest, PortInUseIsAnError) {
  MetricsOptions options;
  const std::string url = metrics_->url();
  options.address = url.substr(7, url.find("/metrics") - 7);
  const absl::Status status = MakeMetrics(store_.get(), options).status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_EQ(status.message(),
            "metrics: cannot open the port; check that it is free");
}

}  // namespace
}  // namespace selfcal::server
