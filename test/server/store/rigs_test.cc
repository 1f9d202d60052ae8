#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using RigsTest = StoreTest;
SELFCAL_STORE_TEST_SUITE(RigsTest);

TEST_P(RigsTest, RigComesBackToTheBitAfterReopening) {
  Rig rig = TestRig("a");
  rig.imu_noise.gyro_noise_density = 1.0 / 3e4;
  rig.prior_sigmas = {{"imu.*", 0.1}, {"*.focal.x", 1.0 / 7}};
  rig.fixed = {"imu.gyro.misalignment.*"};
  rig.min_gain_nats = 0.3;
  rig.retrigger_fraction = 0.7;
  rig.factory.cameras[0].time_offset_s = 1.0 / 77;
  rig.blocks = {{"*.time_offset", true}};
  rig.prior_mean = rig.factory;
  rig.prior_mean->cameras[0].f.x() += 1.0 / 7;
  const auto created = domain_->CreateRig(rig);
  ASSERT_TRUE(created.ok()) << created.status();
  Reopen();
  const auto stored = store_->GetRig("a");
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->create_time_ns, created->create_time_ns);
  ExpectSameCalibration(stored->rig.factory, rig.factory);
  ASSERT_TRUE(stored->rig.prior_mean.has_value());
  ExpectSameCalibration(*stored->rig.prior_mean, *rig.prior_mean);
  EXPECT_EQ(stored->rig.imu_noise.gyro_noise_density,
            rig.imu_noise.gyro_noise_density);
  EXPECT_EQ(PriorSigmas(stored->rig), PriorSigmas(rig));
  EXPECT_EQ(stored->rig.fixed, rig.fixed);
  EXPECT_EQ(stored->rig.min_gain_nats, 0.3);
  EXPECT_EQ(stored->rig.retrigger_fraction, 0.7);
  EXPECT_EQ(stored->rig.blocks, rig.blocks);
  EXPECT_EQ(stored->rig.table_size, rig.table_size);
  EXPECT_EQ(stored->rig.groups.size(), rig.groups.size());
}

TEST_P(RigsTest, FactoryIsVersionOneWithTheTolerancesAsCovariance) {
  Rig rig = TestRig("a");
  rig.fixed = {"imu.gyro.scale.*"};
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto factory = store_->GetActiveCalibration("a");
  ASSERT_TRUE(factory.ok()) << factory.status();
  EXPECT_EQ(factory->version, 1);
  EXPECT_EQ(factory->state, CalibrationState::kActive);
  EXPECT_FALSE(factory->run.has_value());
  EXPECT_FALSE(factory->report.has_value());
  ExpectSameCalibration(factory->theta, rig.factory);
  Eigen::VectorXd variances = PriorSigmas(rig).cwiseAbs2();
  variances.head(3).setZero();                         // the fixed ones
  variances(TimeOffsetComponent(rig.factory, 0)) = 0;  // known
  EXPECT_EQ(factory->covariance, Eigen::MatrixXd(variances.asDiagonal()));
}

TEST_P(RigsTest, TablesOfANewRigAreEmpty) {
  const Rig rig = CreateTestRig("a");
  const auto tables = store_->GetTables("a");
  ASSERT_TRUE(tables.ok());
  ASSERT_EQ(tables->size(), rig.groups.size());
  for (std::size_t k = 0; k < tables->size(); ++k) {
    EXPECT_EQ((*tables)[k].group, rig.groups[k].name);
    EXPECT_EQ((*tables)[k].capacity, rig.table_size);
    EXPECT_TRUE((*tables)[k].entries.empty());
  }
}

TEST_P(RigsTest, SameNameTwiceIsRefusedAndChangesNothing) {
  CreateTestRig("a");
  Rig other = TestRig("a");
  other.table_size = 99;
  EXPECT_TRUE(absl::IsAlreadyExists(domain_->CreateRig(other).status()));
  EXPECT_EQ(store_->GetRig("a")->rig.table_size, TestRig("a").table_size);
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 1u);
}

TEST_P(RigsTest, UnknownRigIsNotFoundEverywhere) {
  EXPECT_TRUE(absl::IsNotFound(store_->GetRig("x").status()));
  EXPECT_TRUE(absl::IsNotFound(domain_->PutSegment("x", Segment(0)).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("x", {"s", 0}).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->ListSegments("x", {}).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetTables("x").status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetActiveCalibration("x").status()));
  EXPECT_TRUE(absl::IsNotFound(store_->ListCalibrations("x", {}).status()));
  EXPECT_TRUE(absl::IsNotFound(domain_->CreateManualRun("x").status()));
  EXPECT_TRUE(absl::IsNotFound(store_->GetRun("x", 1).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->ListRuns("x", {}).status()));
  const auto information = FakeInformation(TestRig("x"), 1);
  EXPECT_TRUE(absl::IsNotFound(
      domain_->CommitScore("x", {"s", 0}, information).status()));
}

TEST_P(RigsTest, CreationIsAnEvent) {
  CreateTestRig("a");
  const auto events = store_->ListEvents({});
  ASSERT_TRUE(events.ok());
  bool found = false;
  for (const StoredEvent& event : events->items) {
    found |= event.kind == EventKind::kRigCreated && event.rig == "a" &&
             event.time_ns > 0;
  }
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace selfcal::server
