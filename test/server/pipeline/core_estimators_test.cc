// The estimators of core in the pipeline: simulated segments become a version.
#include "test/core/simulation/rigs.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class CoreEstimatorsTest : public PipelineTest {
 protected:
  CoreEstimatorsTest() { estimators_ = CoreEstimators(); }

  // Version 2 of the rig "a", which these segments make active.
  StoredCalibration VersionFrom(const std::vector<MotionSegment>& segments) {
    StartOne();
    for (const MotionSegment& segment : segments) {
      const auto result = pipeline_->Submit("a", segment, nullptr);
      EXPECT_TRUE(result.ok()) << result.status();
      EXPECT_EQ(result->verdict, SubmitResult::Verdict::kStored);
    }
    EXPECT_TRUE(AllScored());
    EXPECT_TRUE(RunIs(RunState::kSucceeded));
    const auto version = store_->GetCalibration("a", 2);
    EXPECT_TRUE(version.ok()) << version.status();
    if (!version.ok()) return {};
    EXPECT_THAT(version->reasons, ::testing::IsEmpty());
    EXPECT_EQ(version->state, CalibrationState::kActive);
    return *version;
  }
};

TEST_F(CoreEstimatorsTest, SimulatedSegmentsFillTheTablesAndGiveAVersion) {
  Rig rig = TestRig("a");
  rig.table_size = 4;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto segments = TestSegments(rig, 6);
  StartOne();
  for (const MotionSegment& segment : segments) {
    const auto result = pipeline_->Submit("a", segment, nullptr);
    ASSERT_TRUE(result.ok()) << result.status();
    ASSERT_EQ(result->verdict, SubmitResult::Verdict::kStored)
        << result->violations.front().field;
  }
  ASSERT_TRUE(AllScored());
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok()) << tables.status();
  for (const Table& table : *tables) {
    EXPECT_EQ(table.scored, 6) << table.group;
    EXPECT_EQ(table.entries.size(), 4u) << table.group;
  }
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  const auto second = store_->GetCalibration("a", 2);
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_THAT(second->reasons, ::testing::IsEmpty());
  EXPECT_EQ(second->state, CalibrationState::kActive);
  EXPECT_EQ(second->covariance.rows(), TangentSize(rig.factory));
}

// A rolling shutter of which nothing is known, and a gyroscope that reacts to
// acceleration.
TEST_F(CoreEstimatorsTest, OptionalBlocksOfANewRigAreEstimated) {
  Rig rig = HandheldRig("a");
  rig.table_size = 4;
  rig.blocks = {{"*.line_delay", true}, {"imu.gyro.g_sensitivity", true}};
  Calibration truth = rig.factory;
  AddEstimatedBlocks(rig.blocks, &truth);
  rig.factory = PerturbCalibration(truth, {}, 3);
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  truth.cameras[0].line_delay_s = 60e-6;
  truth.imu.gyro_g_sensitivity.setConstant(3e-4);
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  SimulationOptions options;
  options.seed = 3;
  const StoredCalibration version = VersionFrom(
      Simulate(rig, truth, rig.factory, *MakeHandheld(50, 1, 3), "s", options)
          .segments);
  ASSERT_TRUE(SameShape(version.theta, truth));
  const Eigen::VectorXd error = BoxMinus(version.theta, truth);
  const std::vector<int> added = MatchComponents(
      TangentComponents(truth), {"*.line_delay", "imu.gyro.g_sensitivity.*"});
  ASSERT_EQ(added.size(), 10u);
  for (const int i : added) {
    EXPECT_LT(std::abs(error(i)), 4 * std::sqrt(version.covariance(i, i))) << i;
  }
  EXPECT_LT(std::sqrt(version.covariance(added.back(), added.back())), 1e-6);
}

TEST_F(CoreEstimatorsTest, ASecondImuIsEstimated) {
  Rig rig = HandheldRig("a");
  AddSecondImu(&rig);
  rig.blocks = {{"imu1.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, 3);
  truth.imu1->time_offset_s = 1.5e-3;
  rig.table_size = 4;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  SimulationOptions options;
  options.seed = 3;
  const std::vector<MotionSegment> segments =
      Simulate(rig, truth, rig.factory, *MakeHandheld(30, 1, 3), "s", options)
          .segments;
  const StoredCalibration version = VersionFrom(segments);
  ASSERT_TRUE(SameShape(version.theta, truth));
  const Eigen::VectorXd error = BoxMinus(version.theta, truth);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const std::vector<int> second =
      MatchComponents(TangentComponents(truth), {"imu1.*"});
  ASSERT_EQ(second.size(), 22u);
  for (const int i : second) {
    const double sigma = std::sqrt(version.covariance(i, i));
    EXPECT_LT(std::abs(error(i)), 4 * sigma) << i;
    EXPECT_LT(sigma, 0.3 * prior(i)) << i;
  }
  const auto table = store_->GetTables("a");
  ASSERT_TRUE(table.ok());
  EXPECT_TRUE(std::any_of(table->begin(), table->end(), [](const Table& of) {
    return of.group == "imu1" && of.entries.size() == 4;
  }));
  MotionSegment without = segments.front();
  without.key = {"without", 0};
  without.imu1.clear();
  const auto refused = pipeline_->Submit("a", without, nullptr);
  ASSERT_TRUE(refused.ok()) << refused.status();
  ASSERT_EQ(refused->verdict, SubmitResult::Verdict::kRejected);
  EXPECT_EQ(refused->violations.front().field, "imu1");
}

// A device that is used between 0 and 60 degrees, of whose slopes the rig knows
// nothing.
TEST_F(CoreEstimatorsTest, SlopesOfADeviceThatWarmsUpAreEstimated) {
  Rig rig = HandheldRig("a");
  const Calibration truth = WithSlopes(rig.factory);
  rig.blocks = {{"imu.gyro.scale_slope", true},
                {"imu.accel.scale_slope", true},
                {"*.q_CI_slope", true},
                {"*.focal_slope", true}};
  AddEstimatedBlocks(rig.blocks, &rig.factory);
  rig.factory = PerturbCalibration(rig.factory, {}, 3);
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  SimulationOptions options;
  options.seed = 3;
  const std::vector<MotionSegment> segments = SimulateAtTemperatures(
      rig, truth, {0, 20, 40, 60, 0, 20, 40, 60, 0, 20, 40, 60}, options);
  const StoredCalibration version = VersionFrom(segments);
  MotionSegment unknown = segments.front();
  unknown.key = {"unknown", 0};
  unknown.temperature_c.reset();
  const auto refused = pipeline_->Submit("a", unknown, nullptr);
  ASSERT_TRUE(refused.ok()) << refused.status();
  EXPECT_EQ(refused->verdict, SubmitResult::Verdict::kRejected);
  ASSERT_TRUE(SameShape(version.theta, truth));
  const Eigen::VectorXd error = BoxMinus(version.theta, truth);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const std::vector<int> slopes =
      MatchComponents(TangentComponents(truth), {"*_slope*"});
  ASSERT_EQ(slopes.size(), 11u);
  for (const int i : slopes) {
    const double sigma = std::sqrt(version.covariance(i, i));
    EXPECT_LT(std::abs(error(i)), 4 * sigma) << i;
    EXPECT_LT(sigma, 0.7 * prior(i)) << i;
  }
}

TEST_F(CoreEstimatorsTest, ScoresAreTheSameAfterAStop) {
  const auto segments = TestSegments(TestRig("a"), 4);
  std::vector<Eigen::MatrixXd> matrices[2];
  for (const int trial : {0, 1}) {
    Rig rig = TestRig("rig" + std::to_string(trial));
    rig.table_size = 50;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    StartOne();
    for (const MotionSegment& segment : segments) {
      ASSERT_TRUE(pipeline_->Submit(rig.id, segment, nullptr).ok());
      if (trial == 1) Restart();
    }
    ASSERT_TRUE(AllScored());
    for (const MotionSegment& segment : segments) {
      const auto stored = store_->GetSegment(rig.id, segment.key);
      ASSERT_TRUE(stored.ok());
      ASSERT_TRUE(stored->information.has_value()) << stored->problem;
      matrices[trial].push_back(stored->information->Lambda);
    }
  }
  EXPECT_EQ(matrices[0], matrices[1]);
}

// A rig that was described by the statistics of other devices.
TEST_F(CoreEstimatorsTest, AWrongPriorIsRejectedUntilItIsWidened) {
  const Rig device = TestRig("a");
  const auto segments = TestSegments(device, 8);
  const Eigen::VectorXd wide = PriorSigmas(device);
  const Eigen::VectorXd narrow = 0.1 * wide;
  Eigen::VectorXd off = 3 * narrow;
  for (Eigen::Index k = 0; k < off.size(); k += 2) off(k) = -off(k);
  Rig rig = device;
  rig.table_size = 4;
  rig.min_gain_nats = 0;
  rig.factory = BoxPlus(device.factory, off);
  rig.prior_sigmas.clear();
  const auto components = TangentComponents(rig.factory);
  for (std::size_t k = 0; k < components.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    rig.prior_sigmas.push_back({components[k].name, narrow(i)});
  }
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  StartOne();
  for (const MotionSegment& segment : segments) {
    ASSERT_TRUE(pipeline_->Submit("a", segment, nullptr).ok());
  }
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  const auto rejected = store_->GetCalibration("a", 2);
  ASSERT_TRUE(rejected.ok()) << rejected.status();
  EXPECT_EQ(rejected->state, CalibrationState::kRejected);
  EXPECT_THAT(rejected->reasons,
              ::testing::Contains(
                  ::testing::HasSubstr("The segments contradict the prior")));

  const auto updated = pipeline_->UpdateRig(
      "a",
      [&](StoredRig stored) -> absl::StatusOr<StoredRig> {
        stored.rig.prior_sigmas = device.prior_sigmas;
        return stored;
      },
      "eve",
      "");
  ASSERT_TRUE(updated.ok()) << updated.status();
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
  ASSERT_TRUE(Eventually([&] {
    const auto active = store_->GetActiveCalibration("a");
    return active.ok() && active->version == 3;
  }));
  const auto active = store_->GetActiveCalibration("a");
  const std::vector<int> free = FreeComponents(device);
  const Eigen::VectorXd error =
      BoxMinus(active->theta, device.factory)(free).cwiseQuotient(
          Eigen::VectorXd(wide(free)));
  const Eigen::VectorXd scale = wide(free).cwiseInverse();
  const Eigen::MatrixXd covariance =
      scale.asDiagonal() * active->covariance(free, free) * scale.asDiagonal();
  // The 99.99 % bound of 26 degrees of freedom is 61.7.
  EXPECT_LT(error.dot(covariance.llt().solve(error)), 61.7);
}

// Ids are unique within a session: the same ones in another mean nothing.
TEST_F(CoreEstimatorsTest, LandmarksNeverMatchAcrossSessions) {
  constexpr std::uint64_t kFar = 1'000'000;
  for (const Selection selection : {Selection::kTables, Selection::kJointD}) {
    std::vector<Eigen::VectorXd> values;
    std::vector<std::vector<Table>> tables;
    for (const std::uint64_t offset : {std::uint64_t{0}, kFar}) {
      Rig rig = TestRig(std::string(offset == 0 ? "same" : "other") +
                        (selection == Selection::kTables ? "" : "-joint"));
      rig.selection = selection;
      ASSERT_TRUE(domain_->CreateRig(rig).ok());
      StartOne();
      auto segments = TestSegments(rig, 2, "one", 1);
      for (MotionSegment& segment : TestSegments(rig, 2, "two", 2)) {
        for (Landmark& landmark : segment.landmarks) landmark.id += offset;
        segments.push_back(segment);
      }
      for (const MotionSegment& segment : segments) {
        ASSERT_TRUE(pipeline_->Submit(rig.id, segment, nullptr).ok());
      }
      ASSERT_TRUE(AllScored());
      ASSERT_TRUE(
          Eventually([&] { return store_->ListUnfinishedRuns()->empty(); }));
      const auto run = pipeline_->StartRecalibration(rig.id, true);
      ASSERT_TRUE(run.ok()) << run.status();
      ASSERT_TRUE(
          Eventually([&] { return store_->ListUnfinishedRuns()->empty(); }));
      const std::int64_t version =
          store_->GetRun(rig.id, run->run)->calibration_version;
      const auto calibration = store_->GetCalibration(rig.id, version);
      ASSERT_TRUE(calibration.ok()) << calibration.status();
      values.push_back(ReadableValues(calibration->theta));
      tables.push_back(*store_->GetTables(rig.id));
    }
    EXPECT_EQ(values[0], values[1]);
    ASSERT_EQ(tables[0].size(), tables[1].size());
    for (std::size_t t = 0; t < tables[0].size(); ++t) {
      EXPECT_EQ(tables[0][t].entries, tables[1][t].entries);
    }
  }
}

}  // namespace
}  // namespace selfcal::server
