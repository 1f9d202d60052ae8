// What is remembered of segments without data, with the estimators of core.
#include "server/pipeline/stored_information.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

constexpr int kRememberedSegments = 14;

class MemoryTest : public PipelineTest {
 protected:
  MemoryTest() { estimators_ = CoreEstimators(); }

  // One by one, each followed by the run that it triggers.
  void SubmitAll() {
    ASSERT_TRUE(domain_->CreateRig(TestRig("a")).ok());
    StartOne();
    for (const MotionSegment& segment :
         TestSegments(TestRig("a"), kRememberedSegments)) {
      ASSERT_TRUE(pipeline_->Submit("a", segment, nullptr).ok());
      ASSERT_TRUE(AtRest());
    }
  }

  bool AtRest() {
    return AllScored() &&
           Eventually([&] { return store_->ListUnfinishedRuns()->empty(); });
  }

  StoredCalibration Recalibrated() {
    const auto run = pipeline_->StartRecalibration("a", true);
    EXPECT_TRUE(run.ok()) << run.status();
    EXPECT_TRUE(RunIs(RunState::kSucceeded, run->run));
    return store_
        ->GetCalibration("a",
                         store_->GetRun("a", run->run)->calibration_version)
        .value();
  }

  // Of the segments that were sent.
  int WithoutData() {
    int without = 0;
    for (int k = 0; k < kRememberedSegments; ++k) {
      without += store_->GetSegment("a", {"s", k})->has_data ? 0 : 1;
    }
    return without;
  }
};

TEST_F(MemoryTest, ARunStandsOnTheSegmentsWithoutDataToo) {
  SubmitAll();
  const int without = WithoutData();
  ASSERT_GE(without, 4);
  const StoredCalibration informed = Recalibrated();
  const RememberedUse& use = informed.report->remembered;
  EXPECT_EQ(use.unused, "");
  EXPECT_EQ(use.segments + use.too_far + use.contradicting, without);
  EXPECT_GE(use.segments, without / 2);
  // The same run without a memory.
  estimators_.calibrate = [calibrate = estimators_.calibrate](
                              const Rig& rig,
                              const Calibration& start,
                              const SegmentSource& segments,
                              CalibrateOptions options,
                              const auto&... rest) {
    options.remembered.clear();
    return calibrate(rig, start, segments, options, rest...);
  };
  StartOne();
  const StoredCalibration alone = Recalibrated();
  EXPECT_EQ(alone.report->remembered.segments, 0);
  const std::vector<int> free = FreeComponents(TestRig("a"));
  const Eigen::VectorXd ratio =
      informed.covariance.diagonal()(free).cwiseQuotient(
          alone.covariance.diagonal()(free));
  EXPECT_LT(ratio.maxCoeff(), 1.0);
  EXPECT_LT(ratio.mean(), 0.8);
}

// What a result stands on cannot confirm it.
TEST_F(MemoryTest, HeldOutAreThoseWithDataAlone) {
  SubmitAll();
  const StoredCalibration informed = Recalibrated();
  ASSERT_GT(informed.report->remembered.segments, 0);
  const HeldOutTest& held_out = informed.validation->held_out;
  EXPECT_GT(held_out.segments, 0);
  EXPECT_LE(held_out.segments + held_out.left_out, kReserve);
  EXPECT_EQ(held_out.rescored, held_out.segments);
}

TEST_F(MemoryTest, KeptSegmentsAreScoredAnewAtAVersionThatBecomesActive) {
  SubmitAll();
  const auto at_active = [&] {
    const Calibration active = store_->GetActiveCalibration("a")->theta;
    const auto kept = ListKept(store_.get(), "a");
    EXPECT_GE(kept->size(), 4u);
    return std::all_of(kept->begin(), kept->end(), [&](const auto& segment) {
      return BoxMinus(segment.information->theta0, active).norm() == 0;
    });
  };
  ASSERT_GT(store_->GetActiveCalibration("a")->version, 1);
  EXPECT_TRUE(Eventually(at_active));
  ASSERT_TRUE(pipeline_->ActivateCalibration("a", 1, "me", "a test").ok());
  EXPECT_TRUE(at_active());
}

}  // namespace
}  // namespace selfcal::server
