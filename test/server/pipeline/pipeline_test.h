// A pipeline on a store in a temporary folder, whose estimators are those that
// a test gives it: quick, and able to wait, fail or throw.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/status/status_macros.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_segments.h"
#include "test/support/eventually.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {

class PipelineTest : public ::testing::Test {
 protected:
  PipelineTest() {
    estimators_.score =
        [](const Rig& rig, const Calibration&, const MotionSegment& segment) {
          return FakeInformation(rig, EntropyOf(segment.key.index));
        };
    estimators_.calibrate =
        [](const Rig& rig,
           const Calibration& start,
           const SegmentSource& segments,
           const CalibrateOptions&,
           const ProgressCallback& progress,
           const auto&) -> absl::StatusOr<CalibrationResult> {
      SELFCAL_RETURN_IF_ERROR(ReadAll(segments).status());
      if (!progress({1, 2, 1.0, 1.0})) return Cancelled(start);
      return Converged(rig, start);
    };
    OpenStore();
  }
  ~PipelineTest() override { pipeline_.reset(); }

  static double EntropyOf(std::int64_t index) {
    return static_cast<double>(index * 37 % 11);
  }

  static CalibrationResult Converged(const Rig& rig, const Calibration& start) {
    CalibrationResult result;
    result.status = CalibrateStatus::kConverged;
    result.theta = start;
    result.theta.cameras[0].f.x() += 0.5;
    result.covariance = PriorSigmas(rig).cwiseAbs2().asDiagonal();
    result.observations = 1000;
    result.halves = {25, 26, 0.5};
    return result;
  }

  static CalibrationResult Cancelled(const Calibration& start) {
    CalibrationResult result;
    result.status = CalibrateStatus::kCancelled;
    result.theta = start;
    return result;
  }

  void OpenStore() {
    domain_.reset();
    store_.reset();
    auto store = OpenSqliteStore(folder_.File("selfcal.db"));
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    domain_.emplace(store_.get());
  }

  // Ends the pipeline, if there is one, and makes one of the estimators.
  void MakeOne() {
    pipeline_.reset();
    pipeline_ = MakePipeline(&*domain_, options_, estimators_);
  }
  void StartOne() {
    MakeOne();
    const absl::Status status = pipeline_->Start();
    ASSERT_TRUE(status.ok()) << status;
  }
  // As a crash and a start of the daemon.
  void Restart() {
    pipeline_.reset();
    OpenStore();
    StartOne();
  }

  Rig CreateRig(const std::string& id = "a") {
    const Rig rig = TestRig(id);
    EXPECT_TRUE(domain_->CreateRig(rig).ok());
    return rig;
  }

  static MotionSegment Segment(std::int64_t index) {
    static const std::vector<MotionSegment> kSegments =
        TestSegments(TestRig("any"), 1);
    MotionSegment segment = kSegments.front();
    segment.key.index = index;
    return segment;
  }

  SubmitResult::Verdict Submit(std::int64_t index,
                               const std::string& rig = "a") {
    const auto result =
        pipeline_->Submit(rig, Segment(index), [] { return false; });
    EXPECT_TRUE(result.ok()) << result.status();
    if (!result.ok()) return SubmitResult::Verdict::kRejected;
    for (const Violation& violation : result->violations) {
      ADD_FAILURE() << violation.field << ": " << violation.message;
    }
    return result->verdict;
  }

  bool AllScored() {
    return Eventually([&] { return store_->ListUnscored(1)->empty(); });
  }
  bool RunIs(RunState state, std::int64_t run = 1) {
    return Eventually([&] {
      const auto stored = store_->GetRun("a", run);
      return stored.ok() && stored->state == state;
    });
  }

  TempFolder folder_;
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
  PipelineOptions options_;
  Estimators estimators_;
  std::unique_ptr<Pipeline> pipeline_;
};

}  // namespace selfcal::server
