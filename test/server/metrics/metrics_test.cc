#include "server/metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/domain/domain.h"
#include "test/server/http_get.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
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
                                 ("selfcal_checks_total{outcome=\"differs\","
                                  "subject=\"calibration\"} 0"),
                                 "selfcal_queue_length 0",
                                 "selfcal_database_bytes{file=\"database\"} ",
                                 "selfcal_disk_free_bytes ",
                                 "process_resident_memory_bytes "}) {
    EXPECT_THAT(series, HasSubstr(line));
  }
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
  EXPECT_TRUE(absl::IsUnavailable(MakeMetrics(store_.get(), options).status()));
}

}  // namespace
}  // namespace selfcal::server
