// Where a run starts.
#include <mutex>

#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class RunStart : public PipelineTest {
 protected:
  RunStart() {
    estimators_.calibrate = [this](const Rig& rig,
                                   const Calibration& start,
                                   const SegmentSource&,
                                   const CalibrateOptions&,
                                   const ProgressCallback&,
                                   const auto&) {
      const std::lock_guard lock(mutex_);
      starts_.push_back(start);
      CalibrationResult result = Converged(rig, start);
      result.covariance *= variance_;
      return result;
    };
  }

  // `variance` of the estimates, in units of the prior's.
  void FirstRun(const Rig& rig, double variance) {
    variance_ = variance;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    StartOne();
    for (int k = 0; k < 2; ++k) Submit(k);
    ASSERT_TRUE(RunIs(RunState::kSucceeded));
  }

  // The prior mean, 2 px from the factory calibration.
  static Calibration MeanOf(const Rig& rig) {
    Calibration mean = rig.factory;
    mean.cameras[0].f.x() += 2;
    return mean;
  }

  double FocalOfLastStart() {
    const std::lock_guard lock(mutex_);
    return starts_.back().cameras[0].f.x();
  }

  // Gives the mean to the rig, and starts another run.
  void RunWithMean(const Calibration& mean) {
    const auto updated = pipeline_->UpdateRig(
        "a",
        [&](StoredRig rig) -> absl::StatusOr<StoredRig> {
          rig.rig.prior_mean = mean;
          return rig;
        },
        "eve",
        "");
    ASSERT_TRUE(updated.ok()) << updated.status();
    ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
    ASSERT_TRUE(RunIs(RunState::kSucceeded, 2));
  }

  std::mutex mutex_;
  std::vector<Calibration> starts_;
  double variance_ = 1;
};

TEST_F(RunStart, IsThePriorMeanOfANewRig) {
  Rig rig = TestRig("a");
  rig.prior_mean = MeanOf(rig);
  FirstRun(rig, 1);
  EXPECT_EQ(FocalOfLastStart(), rig.prior_mean->cameras[0].f.x());
}

TEST_F(RunStart, IsTheFactoryCalibrationOfARigWithoutAPriorMean) {
  const Rig rig = TestRig("a");
  FirstRun(rig, 1);
  EXPECT_EQ(FocalOfLastStart(), rig.factory.cameras[0].f.x());
}

// The run before held everything constant.
TEST_F(RunStart, IsThePriorMeanWhereNothingIsKnown) {
  const Rig rig = TestRig("a");
  FirstRun(rig, 1);
  RunWithMean(MeanOf(rig));
  EXPECT_NEAR(FocalOfLastStart(), rig.factory.cameras[0].f.x() + 2, 1e-6);
}

TEST_F(RunStart, IsTheVersionBeforeWhereItIsKnown) {
  const Rig rig = TestRig("a");
  FirstRun(rig, 1e-4);
  RunWithMean(MeanOf(rig));
  // The first run moved it by 0.5.
  EXPECT_NEAR(FocalOfLastStart(), rig.factory.cameras[0].f.x() + 0.5, 1e-3);
}

}  // namespace
}  // namespace selfcal::server
