#include <map>
#include <mutex>
#include <stdexcept>

#include "test/server/pipeline/pipeline_test.h"
#include "test/server/store/sqlite/tamper.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class RecalibrationTest : public PipelineTest {
 protected:
  // The solver iterates until it is told to stop, or the test lets it end.
  void MakeSolverWait() {
    estimators_.calibrate =
        [this](const Rig& rig,
               const Calibration& start,
               const SegmentSource& segments,
               const CalibrateOptions&,
               const ProgressCallback& progress,
               const auto&) -> absl::StatusOr<CalibrationResult> {
      ++solves_;
      SELFCAL_ASSIGN_OR_RETURN(const auto read, ReadAll(segments));
      segments_ = read.size();
      bool stopped = false;
      int k = 0;
      EXPECT_TRUE(Eventually([&] {
        stopped = !finish_ && !progress({++k, 100, 1.0, 1.0});
        return stopped || finish_;
      }));
      return stopped ? Cancelled(start) : Converged(rig, start);
    };
  }

  // Tables of 2: two segments start the first run.
  void FillTables() {
    Submit(0);
    Submit(1);
    ASSERT_TRUE(AllScored());
  }

  std::atomic<int> solves_{0};
  std::atomic<std::size_t> segments_{0};
  std::atomic<bool> finish_{false};
};

TEST_F(RecalibrationTest, FullTablesGiveOneNewVersion) {
  CreateRig();
  options_.program_version = "test";
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  const auto active = store_->GetActiveCalibration("a");
  ASSERT_TRUE(active.ok());
  EXPECT_EQ(active->version, 2);
  EXPECT_EQ(active->run, 1);
  EXPECT_EQ(active->segments.size(), 2u);
  EXPECT_EQ(active->program_version, "test");
  ASSERT_TRUE(active->report.has_value());
  EXPECT_EQ(active->report->status, CalibrateStatus::kConverged);
  Restart();
  Restart();
  EXPECT_EQ(store_->ListRuns("a", {})->items.size(), 1u);
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 2u);
}

TEST_F(RecalibrationTest, NoiseIsReweightedWhereTheRigSaysSo) {
  std::mutex mutex;
  std::map<std::string, bool> reweighted;
  estimators_.calibrate = [&](const Rig& rig,
                              const Calibration& start,
                              const SegmentSource&,
                              const CalibrateOptions& options,
                              const ProgressCallback&,
                              const auto&) {
    const std::lock_guard lock(mutex);
    reweighted[rig.id] = options.reweight_noise;
    return Converged(rig, start);
  };
  options_.calibrate.reweight_noise = false;  // the default is to do so
  Rig rig = TestRig("b");
  rig.reweight_noise = true;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  CreateRig();
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  Submit(0, "b");
  Submit(1, "b");
  ASSERT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return reweighted.size() == 2;
  }));
  EXPECT_FALSE(reweighted.at("a"));
  EXPECT_TRUE(reweighted.at("b"));
}

TEST_F(RecalibrationTest, SolverStartsFromTheActiveVersionOnTheSnapshot) {
  CreateRig();
  finish_ = true;
  MakeSolverWait();
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(segments_, 2u);
  ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
  ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  const auto third = store_->GetActiveCalibration("a");
  EXPECT_EQ(third->version, 3);
  EXPECT_EQ(third->base_version, 2);
  EXPECT_EQ(third->theta.cameras[0].f.x(),
            TestRig("a").factory.cameras[0].f.x() + 1.0);
}

TEST_F(RecalibrationTest, RunSurvivesStopAndStart) {
  CreateRig();
  MakeSolverWait();
  StartOne();
  FillTables();
  for (int k = 1; k <= 5; ++k) {
    ASSERT_TRUE(Eventually([&] { return solves_ == k; }));
    pipeline_->Stop();
    // An orderly stop does not count as an attempt.
    EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kPending);
    EXPECT_EQ(store_->GetRun("a", 1)->attempts, 0);
    ASSERT_TRUE(pipeline_->Start().ok());
  }
  finish_ = true;
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
}

TEST_F(RecalibrationTest, RunThatCrashedStartsAgainButNotForEver) {
  CreateRig();
  MakeSolverWait();
  StartOne();
  FillTables();
  ASSERT_TRUE(Eventually([&] { return solves_ == 1; }));
  pipeline_->Stop();
  // As if the daemon had died in it, twice, then a third time.
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(pipeline_->Start().ok());
  ASSERT_TRUE(Eventually([&] { return solves_ == 2; }));
  pipeline_->Stop();
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  EXPECT_EQ(store_->GetRun("a", 1)->attempts, 3);
  ASSERT_TRUE(pipeline_->Start().ok());
  ASSERT_TRUE(RunIs(RunState::kFailed));
  EXPECT_EQ(solves_, 2);
  EXPECT_NE(store_->GetRun("a", 1)->message.find("3 times"), std::string::npos);
}

TEST_F(RecalibrationTest, CancelEndsARunAtWork) {
  CreateRig();
  MakeSolverWait();
  StartOne();
  FillTables();
  ASSERT_TRUE(Eventually([&] { return solves_ == 1; }));
  const auto cancelled = pipeline_->CancelRecalibration("a", 1);
  ASSERT_TRUE(cancelled.ok()) << cancelled.status();
  EXPECT_EQ(cancelled->state, RunState::kCancelled);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(
      pipeline_->CancelRecalibration("a", 1).status()));
  EXPECT_TRUE(
      absl::IsNotFound(pipeline_->CancelRecalibration("a", 9).status()));
}

TEST_F(RecalibrationTest, CancelEndsARunThatWaits) {
  CreateRig();
  CreateRig("b");
  MakeSolverWait();
  StartOne();
  FillTables();
  ASSERT_TRUE(Eventually([&] { return solves_ == 1; }));
  Submit(0, "b");
  Submit(1, "b");
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(pipeline_->CancelRecalibration("b", 1).ok());
  finish_ = true;
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(store_->GetRun("b", 1)->state, RunState::kCancelled);
}

TEST_F(RecalibrationTest, RunsOfDifferentRigsAreComputedAtOnce) {
  options_.solver_processes = 2;
  MakeSolverWait();
  for (const std::string rig : {"a", "b", "c"}) CreateRig(rig);
  StartOne();
  for (const std::string rig : {"a", "b"}) {
    Submit(0, rig);
    Submit(1, rig);
  }
  ASSERT_TRUE(Eventually([&] { return solves_ == 2; }));
  Submit(0, "c");
  Submit(1, "c");
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(store_->GetRun("c", 1)->state, RunState::kPending);
  // One that is computed, and one that waits.
  ASSERT_TRUE(pipeline_->CancelRecalibration("c", 1).ok());
  ASSERT_TRUE(pipeline_->CancelRecalibration("b", 1).ok());
  EXPECT_EQ(store_->GetRun("b", 1)->state, RunState::kCancelled);
  EXPECT_EQ(store_->GetRun("c", 1)->state, RunState::kCancelled);
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kRunning);
  finish_ = true;
  EXPECT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(solves_, 2);
}

TEST_F(RecalibrationTest, FailureEndsTheRunWithItsMessage) {
  CreateRig();
  std::atomic<bool> throws{true};
  estimators_.calibrate = [&](const auto&,
                              const Calibration& start,
                              const auto&,
                              const auto&,
                              const auto&,
                              const auto&) {
    if (throws) throw std::runtime_error("out of luck");
    CalibrationResult result;
    result.status = CalibrateStatus::kFailed;
    result.message = "no observations";
    result.theta = start;
    return result;
  };
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kFailed));
  EXPECT_NE(store_->GetRun("a", 1)->message.find("out of luck"),
            std::string::npos);
  throws = false;
  ASSERT_TRUE(pipeline_->StartRecalibration("a").ok());
  ASSERT_TRUE(RunIs(RunState::kFailed, 2));
  EXPECT_NE(store_->GetRun("a", 2)->message.find("no observations"),
            std::string::npos);
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 1u);
}

TEST_F(RecalibrationTest, RejectedCandidateIsStoredWithReasonsAndNotActive) {
  CreateRig();
  estimators_.calibrate = [](const Rig& rig,
                             const Calibration& start,
                             const auto&,
                             const auto&,
                             const auto&,
                             const auto&) {
    CalibrationResult result = Converged(rig, start);
    result.status = CalibrateStatus::kNotConverged;
    result.theta.cameras[0].f.x() += 1e4;
    return result;
  };
  StartOne();
  FillTables();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  const auto rejected = store_->GetCalibration("a", 2);
  ASSERT_TRUE(rejected.ok());
  EXPECT_EQ(rejected->state, CalibrationState::kRejected);
  EXPECT_EQ(rejected->reasons.size(), 2u);
  MotionSegment segment = Segment(9);
  segment.calibration_version = 2;  // never published
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->verdict, SubmitResult::Verdict::kRejected);
}

TEST_F(RecalibrationTest, DamagedSegmentFailsTheRunAndLeavesTheTables) {
  CreateRig();
  MakeSolverWait();
  StartOne();
  FillTables();
  pipeline_.reset();
  store_.reset();
  ASSERT_TRUE(DamageSegmentData(folder_.File("selfcal.db"), 0).ok());
  Restart();
  ASSERT_TRUE(RunIs(RunState::kFailed));
  EXPECT_NE(store_->GetRun("a", 1)->message.find("s~0"), std::string::npos);
  ASSERT_TRUE(Eventually([&] {
    return store_->GetSegment("a", {"s", 0})->state == SegmentState::kUnusable;
  }));
  EXPECT_EQ((*store_->GetTables("a"))[0].entries.size(), 1u);
}

TEST_F(RecalibrationTest, ManualRunNeedsSegments) {
  CreateRig();
  StartOne();
  EXPECT_TRUE(
      absl::IsFailedPrecondition(pipeline_->StartRecalibration("a").status()));
  Submit(0);
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(pipeline_->StartRecalibration("a").ok());
  EXPECT_TRUE(RunIs(RunState::kSucceeded));
}

}  // namespace
}  // namespace selfcal::server
