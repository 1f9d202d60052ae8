#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class CalibrationsTest : public StoreTest {
 protected:
  // Fills the tables of a new rig, which starts its first run, and begins it.
  Rig RigWithRun(const std::string& id) {
    const Rig rig = CreateTestRig(id);
    for (int k = 0; k < rig.table_size; ++k) {
      Put(id, k);
      Score(rig, k, k);
    }
    EXPECT_TRUE(store_->BeginRun(id, 1).ok());
    return rig;
  }

  static StoredCalibration Candidate(const Rig& rig) {
    StoredCalibration calibration;
    calibration.theta = rig.factory;
    calibration.theta.cameras[0].f.x() += 1.0 / 3;
    const int size = TangentSize(rig.factory);
    calibration.covariance = Eigen::MatrixXd::Identity(size, size) / 7;
    calibration.covariance(0, 1) = 1.0 / 11;
    calibration.program_version = "1.2.3";
    calibration.seconds = 0.1;
    CalibrationResult report;
    report.status = CalibrateStatus::kConverged;
    report.message = "fine";
    report.iterations = 12;
    report.final_cost = 1.0 / 9;
    report.rank = size - 1;
    report.noise_factors = {{NoiseKind::kAccel, 1.0 / 7, 0.03, 100.5},
                            {NoiseKind::kGyroBiasWalk, 2, 1.5, 0.25}};
    report.held_constant = {{{{"imu.gyro.scale.x", 1.0}}, 0.2}};
    report.observations = 1234;
    report.track_noise_factor = 1.0 / 0.7;
    calibration.report = report;
    return calibration;
  }
};
SELFCAL_STORE_TEST_SUITE(CalibrationsTest);

TEST_P(CalibrationsTest, VersionComesBackWithItsProvenance) {
  const Rig rig = RigWithRun("a");
  const StoredCalibration candidate = Candidate(rig);
  const auto finished = store_->FinishRun("a", 1, candidate);
  ASSERT_TRUE(finished.ok()) << finished.status();
  EXPECT_EQ(finished->version, 2);
  Reopen();
  const auto stored = store_->GetActiveCalibration("a");
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->version, 2);
  EXPECT_EQ(stored->run, 1);
  EXPECT_EQ(stored->base_version, 1);
  EXPECT_THAT(stored->segments,
              ElementsAre(SegmentKey{"s", 0}, SegmentKey{"s", 1}));
  EXPECT_EQ(stored->program_version, "1.2.3");
  EXPECT_EQ(stored->seconds, 0.1);
  EXPECT_EQ(stored->create_time_ns, finished->create_time_ns);
  ExpectSameCalibration(stored->theta, candidate.theta);
  EXPECT_EQ(stored->covariance, candidate.covariance);
  ASSERT_TRUE(stored->report.has_value());
  EXPECT_EQ(stored->report->status, CalibrateStatus::kConverged);
  EXPECT_EQ(stored->report->message, "fine");
  EXPECT_EQ(stored->report->iterations, 12);
  EXPECT_EQ(stored->report->final_cost, 1.0 / 9);
  EXPECT_EQ(stored->report->observations, 1234);
  EXPECT_EQ(stored->report->track_noise_factor, 1.0 / 0.7);
  ASSERT_EQ(stored->report->noise_factors.size(), 2u);
  const NoiseFactor& factor = stored->report->noise_factors[0];
  EXPECT_EQ(factor.kind, NoiseKind::kAccel);
  EXPECT_EQ(factor.factor, 1.0 / 7);
  EXPECT_EQ(factor.log_sigma, 0.03);
  EXPECT_EQ(factor.redundancy, 100.5);
  EXPECT_TRUE(factor.determined());
  EXPECT_FALSE(stored->report->noise_factors[1].determined());
  ASSERT_EQ(stored->report->held_constant.size(), 1u);
  ExpectSameCalibration(stored->report->theta, candidate.theta);
}

TEST_P(CalibrationsTest, VersionTellsTheTemperaturesOfItsSegments) {
  const Rig rig = CreateTestRig("a");
  ASSERT_EQ(rig.table_size, 2);
  for (int k = 0; k < 2; ++k) {
    MotionSegment segment = Segment(k);
    segment.temperature_c = 20 + 5 * k;
    ASSERT_TRUE(store_->PutSegment("a", segment).ok());
    Score(rig, k, k);
  }
  ASSERT_TRUE(store_->BeginRun("a", 1).ok());
  ASSERT_TRUE(store_->FinishRun("a", 1, Candidate(rig)).ok());
  const auto stored = store_->GetActiveCalibration("a");
  ASSERT_TRUE(stored.ok()) << stored.status();
  ASSERT_TRUE(stored->temperatures.has_value());
  EXPECT_EQ(stored->temperatures->segments, 2);
  EXPECT_EQ(stored->temperatures->mean_c, 22.5);
  EXPECT_EQ(stored->temperatures->min_c, 20);
  EXPECT_EQ(stored->temperatures->max_c, 25);
  // The factory's came of none.
  EXPECT_FALSE(store_->GetCalibration("a", 1)->temperatures.has_value());
}

TEST_P(CalibrationsTest, VersionTellsNoTemperatureThatNoSegmentHas) {
  const Rig rig = RigWithRun("a");
  ASSERT_TRUE(store_->FinishRun("a", 1, Candidate(rig)).ok());
  EXPECT_FALSE(store_->GetActiveCalibration("a")->temperatures.has_value());
}

// As one that was stored before cameras had a time offset.
TEST_P(CalibrationsTest, OldVersionHasKnownTimeOffsets) {
  const Rig rig = RigWithRun("a");
  StoredCalibration candidate = Candidate(rig);
  const int offset = TimeOffsetComponent(rig.factory, 0);
  const int size = TangentSize(rig.factory);
  ASSERT_EQ(offset, size - 1) << "one camera";
  const Eigen::MatrixXd old =
      candidate.covariance.topLeftCorner(size - 1, size - 1);
  candidate.covariance = old;
  ASSERT_TRUE(store_->FinishRun("a", 1, candidate).ok());
  const auto stored = store_->GetActiveCalibration("a");
  ASSERT_TRUE(stored.ok()) << stored.status();
  ASSERT_EQ(stored->covariance.rows(), size);
  EXPECT_EQ(stored->covariance.topLeftCorner(size - 1, size - 1), old);
  EXPECT_TRUE(stored->covariance.row(offset).isZero(0));
  EXPECT_TRUE(stored->covariance.col(offset).isZero(0));
  EXPECT_EQ(stored->report->covariance, stored->covariance);
}

TEST_P(CalibrationsTest, ActiveOneSupersedesTheOneBefore) {
  const Rig rig = RigWithRun("a");
  ASSERT_TRUE(store_->FinishRun("a", 1, Candidate(rig)).ok());
  EXPECT_EQ(store_->GetCalibration("a", 1)->state,
            CalibrationState::kSuperseded);
  EXPECT_EQ(store_->GetCalibration("a", 2)->state, CalibrationState::kActive);
  const auto run = store_->GetRun("a", 1);
  EXPECT_EQ(run->state, RunState::kSucceeded);
  EXPECT_EQ(run->calibration_version, 2);
  EXPECT_GT(run->end_time_ns, 0);
}

TEST_P(CalibrationsTest, RejectedOneIsKeptWithItsReasons) {
  const Rig rig = RigWithRun("a");
  StoredCalibration candidate = Candidate(rig);
  candidate.state = CalibrationState::kRejected;
  candidate.reasons = {"too far", "too vague"};
  ASSERT_TRUE(store_->FinishRun("a", 1, candidate).ok());
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  const auto rejected = store_->GetCalibration("a", 2);
  EXPECT_EQ(rejected->state, CalibrationState::kRejected);
  EXPECT_THAT(rejected->reasons, ElementsAre("too far", "too vague"));
  EXPECT_EQ(store_->GetRun("a", 1)->state, RunState::kSucceeded);
  std::vector<EventKind> kinds;
  const auto events = store_->ListEvents({});
  ASSERT_TRUE(events.ok());
  for (const auto& event : events->items) {
    kinds.push_back(event.kind);
  }
  EXPECT_THAT(kinds,
              ElementsAre(EventKind::kRigCreated,
                          EventKind::kCalibrationPublished,
                          EventKind::kRunStarted,
                          EventKind::kCalibrationRejected,
                          EventKind::kRunEnded));
}

TEST_P(CalibrationsTest, VersionsAreListedNewestFirst) {
  const Rig rig = RigWithRun("a");
  ASSERT_TRUE(store_->FinishRun("a", 1, Candidate(rig)).ok());
  const auto first = store_->ListCalibrations("a", {1, ""});
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->items.front().version, 2);
  const auto second = store_->ListCalibrations("a", {1, first->next_token});
  EXPECT_EQ(second->items.front().version, 1);
  EXPECT_TRUE(second->next_token.empty());
  EXPECT_TRUE(absl::IsNotFound(store_->GetCalibration("a", 3).status()));
}

TEST_P(CalibrationsTest, OnlyARunningRunCanProduceOne) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, 1.0);
  ASSERT_TRUE(store_->CreateManualRun("a").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->FinishRun("a", 1, Candidate(rig)).status()));
  ASSERT_TRUE(store_->BeginRun("a", 1).ok());
  ASSERT_TRUE(store_->FinishRun("a", 1, Candidate(rig)).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->FinishRun("a", 1, Candidate(rig)).status()));
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 2u);
}

}  // namespace
}  // namespace selfcal::server
