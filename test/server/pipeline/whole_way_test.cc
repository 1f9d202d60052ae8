// The estimators of core in the pipeline: simulated segments become a version.
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class WholeWayTest : public PipelineTest {
 protected:
  WholeWayTest() { estimators_ = CoreEstimators(); }
};

TEST_F(WholeWayTest, SimulatedSegmentsFillTheTablesAndGiveAVersion) {
  Rig rig = TestRig("a");
  rig.table_size = 4;
  ASSERT_TRUE(store_->CreateRig(rig).ok());
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

TEST_F(WholeWayTest, ScoresAreTheSameAfterAStop) {
  const auto segments = TestSegments(TestRig("a"), 4);
  std::vector<Eigen::MatrixXd> matrices[2];
  for (const int trial : {0, 1}) {
    Rig rig = TestRig("rig" + std::to_string(trial));
    rig.table_size = 50;
    ASSERT_TRUE(store_->CreateRig(rig).ok());
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

}  // namespace
}  // namespace selfcal::server
