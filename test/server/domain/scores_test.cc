#include <limits>

#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ScoresTest = StoreTest;
SELFCAL_STORE_TEST_SUITE(ScoresTest);

TEST_P(ScoresTest, InformationComesBackToTheBitAfterReopening) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  const SegmentInformation information =
      FakeInformation(rig, 1.0 / 3, 2.0 / 3, 77);
  ASSERT_TRUE(domain_->CommitScore("a", {"s", 0}, information).ok());
  Reopen();
  const auto segment = store_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(segment.ok()) << segment.status();
  EXPECT_EQ(segment->state, SegmentState::kScored);
  ASSERT_TRUE(segment->information.has_value());
  const SegmentInformation& stored = *segment->information;
  ExpectSameCalibration(stored.theta0, information.theta0);
  EXPECT_EQ(stored.Lambda, information.Lambda);
  EXPECT_EQ(stored.eta, information.eta);
  EXPECT_EQ(stored.rank, information.rank);
  ASSERT_EQ(stored.unobserved.size(), 1u);
  EXPECT_EQ(stored.unobserved[0].information_ratio, 0.1);
  EXPECT_EQ(stored.unobserved[0].parts[0].component, "imu.gyro.scale.x");
  ASSERT_EQ(stored.groups.size(), rig.groups.size());
  EXPECT_EQ(stored.groups[1].group, information.groups[1].group);
  EXPECT_EQ(stored.groups[1].entropy, 1.0 / 3);
  EXPECT_EQ(stored.groups[1].gain, 2.0 / 3);
  EXPECT_EQ(stored.groups[1].rank, information.groups[1].rank);
  EXPECT_EQ(stored.groups[1].size, information.groups[1].size);
  EXPECT_EQ(stored.residuals.reprojection_rms_px,
            information.residuals.reprojection_rms_px);
  EXPECT_EQ(stored.residuals.inertial_rms, information.residuals.inertial_rms);
  EXPECT_EQ(stored.residuals.second_inertial_rms,
            information.residuals.second_inertial_rms);
  EXPECT_EQ(stored.residuals.imu_gaps, 2);
  EXPECT_EQ(stored.residuals.longest_imu_gap_s, 0.25);
}

// As it was stored before cameras had a time offset.
TEST_P(ScoresTest, OldInformationSaysNothingAboutTimeOffsets) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  SegmentInformation information = FakeInformation(rig, 1, 2, 78);
  const int size = TangentSize(rig.factory);
  ASSERT_EQ(TimeOffsetComponent(rig.factory, 0), size - 1) << "one camera";
  const Eigen::MatrixXd old =
      information.Lambda.topLeftCorner(size - 1, size - 1);
  information.Lambda = old;
  information.eta.conservativeResize(size - 1);
  ASSERT_TRUE(domain_->CommitScore("a", {"s", 0}, information).ok());
  const auto segment = store_->GetSegment("a", {"s", 0});
  ASSERT_TRUE(segment.ok()) << segment.status();
  const SegmentInformation& stored = *segment->information;
  ASSERT_EQ(stored.Lambda.rows(), size);
  EXPECT_EQ(stored.Lambda.topLeftCorner(size - 1, size - 1), old);
  EXPECT_TRUE(stored.Lambda.row(size - 1).isZero(0));
  ASSERT_EQ(stored.eta.size(), size);
  EXPECT_EQ(stored.eta.head(size - 1), information.eta);
  EXPECT_EQ(stored.eta(size - 1), 0);
}

// A segment of another temperature enters although it is poorer, and the one
// that it replaces says why it left.
TEST_P(ScoresTest, TablesOfARigWithSlopesKeepTemperaturesApart) {
  Rig rig = TestRig("a");
  rig.factory.imu.s_g_slope = Eigen::Vector3d::Zero();
  rig.blocks = {{"imu.gyro.scale_slope", true}};
  rig.table_size = 2;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto arrive = [&](int k, double temperature_c, double entropy) {
    MotionSegment segment = Segment(k);
    segment.temperature_c = temperature_c;
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
    Score(rig, k, entropy);
  };
  arrive(0, 22, 1);
  arrive(1, 25, 2);
  arrive(2, 28, 3);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1));
  arrive(3, 51, 9);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 3));
  arrive(4, 55, 10);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 3));
  arrive(5, 24, 0);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(5, 3));
  Reopen();
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(5, 3));
  arrive(6, 54, 8);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(5, 6));
}

TEST_P(ScoresTest, EvictionDropsTheDataAndKeepsTheInformation) {
  const Rig rig = CreateTestRig("a");  // tables of 2
  for (int k = 0; k < 3; ++k) Put("a", k);
  EXPECT_EQ(Score(rig, 0, 3.0).tables.size(), rig.groups.size());
  // Keep the trigger quiet: a run would hold the data.
  EXPECT_TRUE(Score(rig, 1, 1.0).started_run.has_value());
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "test").ok());
  Score(rig, 2, 2.0);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(1, 2));
  RenewReserve(rig);
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_TRUE(HasData("a", 1));
  EXPECT_TRUE(HasData("a", 2));
  const auto evicted = store_->GetSegment("a", {"s", 0});
  EXPECT_TRUE(evicted->information.has_value());
  EXPECT_TRUE(evicted->tables.empty());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->GetSegmentData("a", {"s", 0}).status()));
}

TEST_P(ScoresTest, DataStaysWhileAnyTableHoldsIt) {
  const Rig rig = CreateTestRig("a");
  for (int k = 0; k < 4; ++k) Put("a", k);
  SegmentInformation first = FakeInformation(rig, 9.0);
  first.groups[1].entropy = -9.0;  // best of one group, worst of the others
  ASSERT_TRUE(domain_->CommitScore("a", {"s", 0}, first).ok());
  for (int k = 1; k < 4; ++k) Score(rig, k, 1.0);
  const auto stored = store_->GetSegment("a", {"s", 0});
  EXPECT_THAT(stored->tables, ElementsAre(rig.groups[1].name));
  EXPECT_TRUE(HasData("a", 0));
}

TEST_P(ScoresTest, SegmentThatGainsTooLittleEntersNoTable) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  const ScoreCommit commit = Score(rig, 0, -5.0, rig.min_gain_nats - 1e-9);
  EXPECT_TRUE(commit.tables.empty());
  EXPECT_EQ((*store_->GetTables("a"))[0].scored, 1);
  RenewReserve(rig);
  EXPECT_FALSE(HasData("a", 0));
}

TEST_P(ScoresTest, SecondScoreOfASegmentChangesNothing) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  Score(rig, 0, 3.0);
  const ScoreCommit again = Score(rig, 0, -3.0);
  EXPECT_EQ(again.tables.size(), rig.groups.size());
  EXPECT_EQ((*store_->GetTables("a"))[0].entries[0].entropy, 3.0);
  EXPECT_EQ((*store_->GetTables("a"))[0].scored, 1);
}

TEST_P(ScoresTest, CountOfOfferedSegmentsSurvivesReopening) {
  const Rig rig = CreateTestRig("a");
  for (int k = 0; k < 5; ++k) {
    Put("a", k);
    Score(rig, k, 1.0, 0.0);
    Reopen();
  }
  EXPECT_EQ((*store_->GetTables("a"))[0].scored, 5);
  EXPECT_FALSE((*store_->GetTables("a"))[0].starved());
  for (int k = 5; k < 20; ++k) {
    Put("a", k);
    Score(rig, k, 1.0, 0.0);
  }
  Reopen();
  EXPECT_TRUE((*store_->GetTables("a"))[0].starved());
}

TEST_P(ScoresTest, ScoreThatIsNotANumberEntersNoTable) {
  const Rig rig = CreateTestRig("a");
  Put("a", 0);
  const ScoreCommit commit =
      Score(rig, 0, std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(commit.tables.empty());
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->state, SegmentState::kScored);
}

TEST_P(ScoresTest, RigsDoNotShareTables) {
  const Rig a = CreateTestRig("a");
  const Rig b = CreateTestRig("b");
  Put("a", 0);
  Put("b", 0);
  Score(a, 0, 1.0);
  EXPECT_TRUE(TableIndices("b", 0).empty());
  Score(b, 0, 2.0);
  EXPECT_EQ((*store_->GetTables("a"))[0].entries[0].entropy, 1.0);
  EXPECT_EQ((*store_->GetTables("b"))[0].entries[0].entropy, 2.0);
}

}  // namespace
}  // namespace selfcal::server
