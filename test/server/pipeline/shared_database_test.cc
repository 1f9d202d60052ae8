// Pipelines that share a PostgreSQL database, each with a store of its own:
// what one does, the watchers of the others learn.
#include <mutex>

#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/postgres/postgres_engine.h"

namespace selfcal::server {
namespace {

class SharedDatabase : public PipelineTest {
 protected:
  // A daemon, as far as the pipeline goes.
  struct Daemon {
    std::unique_ptr<Store> store;
    std::unique_ptr<Domain> domain;
    std::unique_ptr<Pipeline> pipeline;
  };

  void SetUp() override {
    const std::string why_not = PostgresCluster::WhyNot();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
    options_.replica.shared = true;
    options_.replica.beat = std::chrono::milliseconds(50);
    for (Daemon* daemon : {&a_, &b_}) {
      auto store = OpenSharedPostgresStore(database_);
      ASSERT_TRUE(store.ok()) << store.status();
      daemon->store = *std::move(store);
      daemon->domain = std::make_unique<Domain>(daemon->store.get());
      daemon->pipeline =
          MakePipeline(daemon->domain.get(), options_, estimators_);
      const absl::Status started = daemon->pipeline->Start();
      ASSERT_TRUE(started.ok()) << started;
    }
    ASSERT_TRUE(a_.domain->CreateRig(TestRig("a")).ok());
  }

  void SubmitTo(const Daemon& daemon, std::int64_t index) {
    const auto result =
        daemon.pipeline->Submit("a", Segment(index), [] { return false; });
    ASSERT_TRUE(result.ok()) << result.status();
  }

  const TempFolder database_;
  Daemon a_;
  Daemon b_;
};

TEST_F(SharedDatabase, AWatchSeesActivationsOfEveryDaemonOnceAndInOrder) {
  std::mutex mutex;
  std::vector<std::int64_t> seen;
  const auto watch =
      b_.pipeline->WatchCalibration("a", [&](const auto& active) {
        const std::lock_guard lock(mutex);
        seen.push_back(active->version);
      });
  ASSERT_TRUE(watch.ok()) << watch.status();
  const auto has_seen = [&](const std::vector<std::int64_t>& versions) {
    return Eventually([&] {
      const std::lock_guard lock(mutex);
      return seen == versions;
    });
  };
  ASSERT_TRUE(has_seen({1}));
  SubmitTo(a_, 0);
  SubmitTo(a_, 1);  // the tables are full
  EXPECT_TRUE(has_seen({1, 2}));
  ASSERT_TRUE(a_.pipeline->ActivateCalibration("a", 1, "test", "back").ok());
  EXPECT_TRUE(has_seen({1, 2, 1}));
  ASSERT_TRUE(b_.pipeline->ActivateCalibration("a", 2, "test", "forth").ok());
  EXPECT_TRUE(has_seen({1, 2, 1, 2}));
}

TEST_F(SharedDatabase, AWatchSeesWhatAnotherDaemonFindsAboutTheActiveVersion) {
  SubmitTo(a_, 0);
  SubmitTo(a_, 1);  // the tables are full
  ASSERT_TRUE(Eventually(
      [&] { return a_.store->GetActiveCalibration("a")->version == 2; }));
  std::atomic<int> seen = 0;
  std::atomic<bool> is_doubted = false;
  const auto watch =
      b_.pipeline->WatchCalibration("a", [&](const auto& active) {
        is_doubted = active->finding == "biased";
        ++seen;
      });
  ASSERT_TRUE(watch.ok()) << watch.status();
  ASSERT_EQ(seen, 1);
  ASSERT_TRUE(a_.domain->ReportDisagreement("a", 2, "biased").ok());
  EXPECT_TRUE(Eventually([&] { return is_doubted.load(); }));
  EXPECT_EQ(seen, 2);
}

TEST_F(SharedDatabase, ADeletionIsAnnouncedAndANewRigOfTheNameIsNotWatched) {
  std::mutex mutex;
  std::vector<std::string> deleted;
  b_.pipeline->ListenForDeletions([&](const std::string& rig) {
    const std::lock_guard lock(mutex);
    if (!rig.empty()) deleted.push_back(rig);
  });
  std::vector<std::int64_t> of_old;
  std::vector<std::int64_t> of_new;
  const auto watch = [&](std::vector<std::int64_t>* seen) {
    auto subscription =
        b_.pipeline->WatchCalibration("a", [&, seen](const auto& active) {
          const std::lock_guard lock(mutex);
          seen->push_back(active->version);
        });
    EXPECT_TRUE(subscription.ok()) << subscription.status();
    return *std::move(subscription);
  };
  const auto old_watch = watch(&of_old);
  ASSERT_TRUE(a_.pipeline->DeleteRig("a", "test", "sold").ok());
  EXPECT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return deleted == std::vector<std::string>{"a"};
  }));
  ASSERT_TRUE(a_.domain->CreateRig(TestRig("a")).ok());
  const auto new_watch = watch(&of_new);
  SubmitTo(a_, 0);
  SubmitTo(a_, 1);  // the tables are full
  EXPECT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return of_new == std::vector<std::int64_t>{1, 2};
  }));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(of_old, std::vector<std::int64_t>{1});
}

TEST_F(SharedDatabase, AWatchSeesTheEndOfARunOfAnotherDaemon) {
  SubmitTo(a_, 0);
  ASSERT_TRUE(Eventually([&] { return a_.store->ListUnscored(1)->empty(); }));
  const auto run = a_.pipeline->StartRecalibration("a");
  ASSERT_TRUE(run.ok()) << run.status();
  std::atomic<bool> has_ended = false;
  const auto watch =
      b_.pipeline->WatchRun("a", run->run, [&](const RunUpdate& update) {
        if (update.run.end_time_ns != 0) has_ended = true;
      });
  ASSERT_TRUE(watch.ok()) << watch.status();
  EXPECT_TRUE(Eventually([&] { return has_ended.load(); }));
}

}  // namespace
}  // namespace selfcal::server
