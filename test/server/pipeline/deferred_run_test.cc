// Runs that wait for a better time, take too long, or go on from a candidate.
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <mutex>

#include "server/domain/clock.h"
#include "test/server/pipeline/fake_conditions.h"
#include "test/server/pipeline/pipeline_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kSecond = 1'000'000'000;

class DeferredRunTest : public PipelineTest {
 protected:
  DeferredRunTest() {
    options_.recheck = std::chrono::milliseconds(5);
    options_.conditions = &conditions_;
    // Tests move the clock; none of them ends a session.
    options_.session_idle = std::chrono::milliseconds(0);
    options_.now_ns = [this] { return NowNs() + ahead_ns_.load(); };
  }
  ~DeferredRunTest() override { pipeline_.reset(); }

  // Tables of 2: two segments start the first run.
  void FillTables() {
    Submit(0);
    Submit(1);
    ASSERT_TRUE(AllScored());
  }
  bool MessageIs(const std::string& part, std::int64_t run = 1) {
    return Eventually([&] {
      const auto stored = store_->GetRun("a", run);
      return stored.ok() && stored->message.find(part) != std::string::npos;
    });
  }
  int CountDeferred() {
    const auto events = store_->ListEvents({1000, ""});
    return static_cast<int>(std::count_if(
        events->items.begin(), events->items.end(), [](const auto& event) {
          return event.kind == EventKind::kRunDeferred;
        }));
  }

  FakeConditions conditions_;
  std::atomic<std::int64_t> ahead_ns_{0};
};

TEST_F(DeferredRunTest, RunWaitsForTheConditionsAndSaysWhy) {
  CreateRig();
  conditions_.Set("the device runs on battery");
  StartOne();
  FillTables();
  ASSERT_TRUE(MessageIs("battery"));
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kPending);
  conditions_.Set("the load is high");
  ASSERT_TRUE(MessageIs("load"));
  Restart();
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kPending);
  conditions_.Set("");
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(store_->GetRun("a", 1)->message, "");
  EXPECT_EQ(store_->GetRun("a", 1)->attempts, 1);
  EXPECT_EQ(CountDeferred(), 1);
}

TEST_F(DeferredRunTest, RunThatWaitsCanBeCancelled) {
  CreateRig();
  conditions_.Set("the device runs on battery");
  StartOne();
  FillTables();
  ASSERT_TRUE(MessageIs("battery"));
  ASSERT_TRUE(pipeline_->CancelRecalibration("a", 1).ok());
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kCancelled);
}

TEST_F(DeferredRunTest, RunByHandDoesNotWait) {
  RigPolicy policy;
  policy.recalibration_min_interval_ns = 3600 * kSecond;
  ASSERT_TRUE(domain_->CreateRig(TestRig("a"), policy).ok());
  conditions_.Set("the device runs on battery");
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  for (const int run : {1, 2}) {
    ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
    ASSERT_TRUE(RunIs(RunState::kSucceeded, run));
  }
}

TEST_F(DeferredRunTest, NextRunWaitsForTheMinimumInterval) {
  RigPolicy policy;
  policy.recalibration_min_interval_ns = 3600 * kSecond;
  ASSERT_TRUE(domain_->CreateRig(TestRig("a"), policy).ok());
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  Submit(3);  // richer than one of them
  ASSERT_TRUE(MessageIs("minimum interval of 3600 s", 2));
  EXPECT_EQ(store_->GetRun("a", 2)->state, RunState::kPending);
  ahead_ns_ = 3601 * kSecond;
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
}

TEST_F(DeferredRunTest, OldCalibrationIsComputedAnew) {
  Rig rig = TestRig("a");
  rig.retrigger_fraction = 1;
  RigPolicy policy;
  policy.calibration_max_age_ns = 3600 * kSecond;
  ASSERT_TRUE(domain_->CreateRig(rig, policy).ok());
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  Submit(3);  // half of the tables are new: not enough
  ASSERT_TRUE(AllScored());
  ahead_ns_ = 3601 * kSecond;
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  EXPECT_EQ(store_->GetRun("a", 2)->trigger, RunTrigger::kCalibrationAged);
}

TEST_F(DeferredRunTest, RunThatTakesTooLongFails) {
  CreateRig();
  options_.max_run_time = std::chrono::milliseconds(20);
  estimators_.calibrate = [](const Rig&,
                             const Calibration& start,
                             const auto&,
                             const auto&,
                             const ProgressCallback& progress,
                             const auto&) {
    int k = 0;
    EXPECT_TRUE(Eventually([&] { return !progress({++k, 100, 1.0, 1.0}); }));
    return Cancelled(start);
  };
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kFailed));
  EXPECT_THAT(store_->GetRun("a", 1)->message, HasSubstr("longer than"));
}

TEST_F(DeferredRunTest, RunGoesOnFromTheCandidateThatItHasStored) {
  CreateRig();
  std::atomic<int> solves{0};
  estimators_.calibrate = [&](const Rig& rig,
                              const Calibration& start,
                              const auto&,
                              const auto&,
                              const auto&,
                              const auto&) {
    ++solves;
    return Converged(rig, start);
  };
  conditions_.Set("wait");
  StartOne();
  FillTables();
  ASSERT_TRUE(MessageIs("wait"));
  pipeline_->Stop();
  // As if the daemon had died after it had stored what it found.
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  const auto factory = store_->GetActiveCalibration("a");
  StoredCalibration found;
  const CalibrationResult result = Converged(TestRig("a"), factory->theta);
  found.theta = result.theta;
  found.covariance = result.covariance;
  found.report = result;
  ASSERT_TRUE(domain_->StoreCandidate("a", 1, found).ok());
  Restart();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(solves, 0);
  const auto active = store_->GetActiveCalibration("a");
  EXPECT_EQ(active->version, 2);
  ASSERT_TRUE(active->validation.has_value());
  EXPECT_EQ(active->validation->active_version, 1);
  EXPECT_EQ(active->validation->checks.size(), 17u);
}

TEST_F(DeferredRunTest, ActivationByHandDuringARunIsWhatItIsJudgedAgainst) {
  CreateRig();
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  std::atomic<bool> solving{false};
  std::atomic<bool> go_on{false};
  estimators_.calibrate = [&](const Rig& rig,
                              const Calibration& start,
                              const auto&,
                              const auto&,
                              const auto&,
                              const auto&) {
    solving = true;
    EXPECT_TRUE(Eventually([&] { return go_on.load(); }));
    return Converged(rig, start);
  };
  StartOne();
  ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
  ASSERT_TRUE(Eventually([&] { return solving.load(); }));
  ASSERT_TRUE(pipeline_->ActivateCalibration("a", 1, "me", "drifts").ok());
  go_on = true;
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  const auto active = store_->GetActiveCalibration("a");
  EXPECT_EQ(active->version, 3);
  EXPECT_EQ(active->validation->active_version, 1);
}

}  // namespace
}  // namespace selfcal::server
