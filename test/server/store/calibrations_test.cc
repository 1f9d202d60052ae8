#include "selfcal/store/records.pb.h"
#include "server/store/records.h"
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
    EXPECT_TRUE(domain_->BeginRun(id, 1).ok());
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
    report.noise_scales = {
        {NoiseKind::kAccel, 1.0 / 7, 0.03, 100.5, 1.0 / 6, true},
        {NoiseKind::kGyroBiasWalk, 2, 1.5, 0.25, 1, false}};
    report.segment_fits = {
        {{"s", 0}, 1.0 / 3, 1.0 / 13, {26.5, 25, 1.0 / 17}, ""},
        {{"s", 1}, 0, 893, {}, "its inertial residuals"}};
    report.halves = {1.0 / 19, 26, 1.0 / 23};
    report.held_constant = {{{{"imu.gyro.scale.x", 1.0}}, 0.2}};
    report.observations = 1234;
    report.track_noise_factor = 1.0 / 0.7;
    calibration.report = report;
    return calibration;
  }
};
SELFCAL_STORE_TEST_SUITE(CalibrationsTest);

TEST_P(CalibrationsTest, TheFirstDisagreementStaysWithItsVersion) {
  const Rig rig = RigWithRun("a");
  ASSERT_TRUE(domain_->FinishRun("a", 1, Candidate(rig)).ok());
  EXPECT_EQ(store_->GetActiveCalibration("a")->finding, "");
  ASSERT_TRUE(domain_->ReportDisagreement("a", 2, "by 3 sigma").ok());
  ASSERT_TRUE(domain_->ReportDisagreement("a", 2, "by 5 sigma").ok());
  EXPECT_TRUE(
      absl::IsNotFound(domain_->ReportDisagreement("a", 3, "by 1 sigma")));
  EXPECT_TRUE(
      absl::IsNotFound(domain_->ReportDisagreement("b", 1, "by 1 sigma")));
  Reopen();
  const auto active = store_->GetActiveCalibration("a");
  ASSERT_TRUE(active.ok()) << active.status();
  EXPECT_EQ(active->state, CalibrationState::kActive);
  EXPECT_EQ(active->finding, "by 3 sigma");
  EXPECT_EQ(store_->GetCalibration("a", 1)->finding, "");
  EXPECT_EQ(store_->ListCalibrations("a", {})->items[0].finding, "by 3 sigma");
  std::vector<std::string> details;
  const auto events = store_->ListEvents({100, ""}, "a");
  ASSERT_TRUE(events.ok()) << events.status();
  for (const StoredEvent& event : events->items) {
    if (event.kind == EventKind::kCoresDisagree) {
      details.push_back(event.detail);
    }
  }
  EXPECT_THAT(details,
              ElementsAre("version 2: by 3 sigma", "version 2: by 5 sigma"));
}

TEST_P(CalibrationsTest, VersionComesBackWithItsProvenance) {
  const Rig rig = RigWithRun("a");
  const StoredCalibration candidate = Candidate(rig);
  const auto finished = domain_->FinishRun("a", 1, candidate);
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
  ASSERT_EQ(stored->report->noise_scales.size(), 2u);
  const NoiseScale& factor = stored->report->noise_scales[0];
  EXPECT_EQ(factor.kind, NoiseKind::kAccel);
  EXPECT_EQ(factor.factor, 1.0 / 7);
  EXPECT_EQ(factor.log_sigma, 0.03);
  EXPECT_EQ(factor.redundancy, 100.5);
  EXPECT_TRUE(factor.determined());
  EXPECT_EQ(factor.used, 1.0 / 6);
  EXPECT_TRUE(factor.converged);
  EXPECT_FALSE(stored->report->noise_scales[1].determined());
  EXPECT_FALSE(stored->report->noise_scales[1].converged);
  ASSERT_EQ(stored->report->segment_fits.size(), 2u);
  const SegmentFit& fit = stored->report->segment_fits[0];
  EXPECT_EQ(fit.key, (SegmentKey{"s", 0}));
  EXPECT_EQ(fit.pixel_ratio, 1.0 / 3);
  EXPECT_EQ(fit.inertial_ratio, 1.0 / 13);
  EXPECT_EQ(fit.others.statistic, 26.5);
  EXPECT_EQ(fit.others.degrees, 25);
  EXPECT_EQ(fit.others.probability, 1.0 / 17);
  EXPECT_EQ(fit.excluded, "");
  EXPECT_EQ(stored->report->segment_fits[1].others.probability, 1);
  EXPECT_EQ(stored->report->segment_fits[1].excluded, "its inertial residuals");
  EXPECT_EQ(stored->report->halves.statistic, 1.0 / 19);
  EXPECT_EQ(stored->report->halves.degrees, 26);
  EXPECT_EQ(stored->report->halves.probability, 1.0 / 23);
  ASSERT_EQ(stored->report->held_constant.size(), 1u);
  ExpectSameCalibration(stored->report->theta, candidate.theta);
}

TEST_P(CalibrationsTest, AStalledSolverIsRememberedAsThat) {
  const Rig rig = RigWithRun("a");
  StoredCalibration candidate = Candidate(rig);
  candidate.state = CalibrationState::kRejected;
  candidate.report->status = CalibrateStatus::kStalled;
  ASSERT_TRUE(domain_->FinishRun("a", 1, candidate).ok());
  EXPECT_EQ(store_->GetCalibration("a", 2)->report->status,
            CalibrateStatus::kStalled);
}

// Without what is recorded since.
TEST(CalibrationRecord, OfAnOlderVersionReadsAsNotTested) {
  const Rig rig = TestRig("a");
  StoredCalibration version;
  version.rig = "a";
  version.version = 2;
  version.run = 1;
  version.theta = rig.factory;
  const int size = TangentSize(rig.factory);
  version.covariance = Eigen::MatrixXd::Identity(size, size);
  version.report = CalibrationResult();
  version.report->noise_scales = {{NoiseKind::kGyro, 3, 0.05, 100}};
  version.validation = StoredValidation();
  version.validation->checks = {{"converged", 1, 1, CheckOutcome::kPassed},
                                {"rank", 1, 2, CheckOutcome::kFailed}};
  store::CalibrationRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeCalibration(version)));
  auto* factor = record.mutable_report()->mutable_noise_factors(0);
  factor->clear_used();
  factor->clear_converged();
  record.mutable_report()->clear_halves();
  store::ValidationRecord validation;
  ASSERT_TRUE(validation.ParseFromString(SerializeValidation(version)));
  validation.clear_verdict();
  for (auto& check : *validation.mutable_validation()->mutable_checks()) {
    check.clear_outcome();
    check.clear_sentence();
  }

  auto read = ParseCalibration(record.SerializeAsString(), "it");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->report->noise_scales[0].used, 1);
  EXPECT_TRUE(read->report->noise_scales[0].converged);
  EXPECT_TRUE(read->report->segment_fits.empty());
  EXPECT_EQ(read->report->halves.degrees, 0);
  EXPECT_EQ(read->report->halves.probability, 1);
  ASSERT_TRUE(
      ParseValidation(validation.SerializeAsString(), "it", &*read).ok());
  EXPECT_EQ(read->verdict.kind, VerdictKind::kUnknown);
  EXPECT_EQ(read->validation->checks[0].outcome, CheckOutcome::kPassed);
  EXPECT_EQ(read->validation->checks[1].outcome, CheckOutcome::kFailed);
}

TEST_P(CalibrationsTest, VersionTellsTheTemperaturesOfItsSegments) {
  const Rig rig = CreateTestRig("a");
  ASSERT_EQ(rig.table_size, 2);
  for (int k = 0; k < 2; ++k) {
    MotionSegment segment = Segment(k);
    segment.temperature_c = 20 + 5 * k;
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
    Score(rig, k, k);
  }
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, Candidate(rig)).ok());
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
  ASSERT_TRUE(domain_->FinishRun("a", 1, Candidate(rig)).ok());
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
  ASSERT_TRUE(domain_->FinishRun("a", 1, candidate).ok());
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
  ASSERT_TRUE(domain_->FinishRun("a", 1, Candidate(rig)).ok());
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
  ASSERT_TRUE(domain_->FinishRun("a", 1, candidate).ok());
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
  ASSERT_TRUE(domain_->FinishRun("a", 1, Candidate(rig)).ok());
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
  ASSERT_TRUE(domain_->CreateManualRun("a").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->FinishRun("a", 1, Candidate(rig)).status()));
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  const auto finished = domain_->FinishRun("a", 1, Candidate(rig));
  ASSERT_TRUE(finished.ok()) << finished.status();
  EXPECT_TRUE(absl::IsFailedPrecondition(
      domain_->FinishRun("a", 1, Candidate(rig)).status()));
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 2u);
}

}  // namespace
}  // namespace selfcal::server
