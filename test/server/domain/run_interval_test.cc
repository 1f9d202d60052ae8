#include "server/domain/run_interval.h"

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

class RunIntervalTest : public StoreTest {
 protected:
  void Create(std::int64_t interval_ns) {
    RigPolicy policy;
    policy.recalibration_min_interval_ns = interval_ns;
    const Rig rig = TestRig("a");
    ASSERT_TRUE(domain_->CreateRig(rig, policy).ok());
    Put("a", 0);
    Score(rig, 0, 1.0);
  }
  StoredRun CreateRun() {
    const auto run = domain_->CreateManualRun("a", true);
    EXPECT_TRUE(run.ok()) << run.status();
    return run.value_or(StoredRun());
  }
  // The steady time at which it ended.
  std::int64_t EndRun(std::int64_t run) {
    EXPECT_TRUE(domain_->EndRun("a", run, RunState::kFailed, "broke").ok());
    return store_->GetRun("a", run)->end_steady_ns;
  }
  std::string Reason(const StoredRun& run, std::int64_t now_ns) {
    return IntervalReason(store_.get(), run, now_ns).value_or("failed");
  }
};
SELFCAL_STORE_TEST_SUITE(RunIntervalTest);

TEST_P(RunIntervalTest, TheNextRunWaitsUntilTheIntervalAfterTheLastOneIsOver) {
  constexpr std::int64_t kInterval_ns = 1'500'000'000;
  Create(kInterval_ns);
  EndRun(CreateRun().run);
  const std::int64_t end_ns = EndRun(CreateRun().run);
  const StoredRun run = CreateRun();
  EXPECT_EQ(Reason(run, end_ns + kInterval_ns - 1),
            "the minimum interval of 1.5 s since recalibration 2 is not over");
  EXPECT_EQ(Reason(run, end_ns + kInterval_ns), "");
}

TEST_P(RunIntervalTest, TheFirstRunDoesNotWait) {
  Create(1'500'000'000);
  const StoredRun run = CreateRun();
  EXPECT_EQ(Reason(run, run.create_steady_ns), "");
}

TEST_P(RunIntervalTest, WithoutAnIntervalNoRunWaits) {
  Create(0);
  const std::int64_t end_ns = EndRun(CreateRun().run);
  EXPECT_EQ(Reason(CreateRun(), end_ns), "");
}

TEST_P(RunIntervalTest, AnUnknownRigIsAnError) {
  StoredRun run;
  run.rig = "unknown";
  EXPECT_TRUE(absl::IsNotFound(IntervalReason(store_.get(), run, 0).status()));
}

}  // namespace
}  // namespace selfcal::server
