#include "server/pipeline/run_options.h"

#include "test/core/change/random_information.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class RunOptionsTest : public PipelineTest {};

TEST_F(RunOptionsTest, WhatIsKnownFromBeforeAChangeFadesUntilTheRun) {
  const Rig rig = TestRig("a");
  RigPolicy policy;
  policy.walk_densities = {{"imu.gyro.scale.*", 1e-3}};
  ASSERT_TRUE(domain_->CreateRig(rig, policy).ok());
  RandomInformation random(5);
  const auto put = [&](std::int64_t k, double q_CI_x) {
    MotionSegment segment = TestSegments(rig, 1).front();
    segment.key = {"s", k};
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
    Eigen::VectorXd offset = Eigen::VectorXd::Zero(TangentSize(rig.factory));
    const int i =
        MatchComponents(TangentComponents(rig.factory), {"cam0.q_CI.x"}).at(0);
    offset(i) = q_CI_x * ReferenceSigmas(rig)(i);
    SegmentInformation information = random.Segment(rig, rig.factory, offset);
    information.residuals.fit = 1;
    information.groups = ScoreGroups(rig, information.Lambda);
    ASSERT_TRUE(domain_->CommitScore("a", {"s", k}, information).ok());
  };
  std::int64_t k = 0;
  while (store_->ListUnfinishedRuns()->empty() && k < 50) put(k++, 0);
  const StoredRun first = store_->ListUnfinishedRuns()->at(0);
  ASSERT_TRUE(domain_->BeginRun("a", first.run).ok());
  StoredCalibration result;
  result.theta = rig.factory;
  result.covariance = FactoryKnownTo(rig, 0.04).covariance;
  result.report = CalibrationResult();
  result.report->status = CalibrateStatus::kConverged;
  result.report->track_noise_factor = 1;
  ASSERT_TRUE(domain_->FinishRun("a", first.run, result).ok());
  while (!store_->GetChange("a", 1).ok() && k < 100) put(k++, 15);
  ASSERT_TRUE(store_->GetChange("a", 1).ok());

  StoredRun run = first;
  run.change = 1;
  run.segments = {{"s", k - 1}};
  const auto scale_information = [&](double days) {
    run.create_steady_ns = store_->GetActiveCalibration("a")->create_steady_ns +
                           static_cast<std::int64_t>(days * 86'400e9);
    const auto options = OptionsOfRun(&*domain_, {}, *store_->GetRig("a"), run);
    EXPECT_TRUE(options.ok()) << options.status();
    const int i =
        MatchComponents(TangentComponents(rig.factory), {"imu.gyro.scale.x"})
            .at(0);
    return options->prior->information(i, i);
  };
  const double at_once = scale_information(0);
  // Its walk adds 1e-3 after a day, 1e-2 after 100.
  // The others age as well, and tell less of it.
  EXPECT_NEAR(1 / scale_information(100), 1e-4 + 1 / at_once, 5e-6);
  EXPECT_LT(1 / at_once, 1e-5);
}

}  // namespace
}  // namespace selfcal::server
