#include "server/pipeline/cohort_report.h"

#include <cmath>

#include "test/server/pipeline/calibrated_devices.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

constexpr int kFocal = 15 + 6;  // of camera 0: after the IMU and its pose
constexpr double kMean_px = 3;
constexpr double kSpread_px = 0.5;

using CohortReportTest = CalibratedDevices;

TEST_F(CohortReportTest, FindsMeanSpreadAndWhoIsNotLikeTheOthers) {
  // Evenly about the mean, with the standard deviation of the spread.
  constexpr int kDevices = 24;
  for (int k = 0; k < kDevices; ++k) {
    const double step = (k - 0.5 * (kDevices - 1)) /
                        std::sqrt((kDevices * kDevices - 1) / 12.0);
    Calibrate("device" + std::to_string(k), kMean_px + kSpread_px * step);
  }
  Calibrate("knocked", kMean_px + 20 * kSpread_px);
  CreateRig("new");
  const auto report = DescribeCohort(store_.get(), {}, 100);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->rigs, kDevices + 2);
  EXPECT_EQ(report->calibrated, kDevices + 1);
  EXPECT_FALSE(report->truncated);
  const auto components = TangentComponents(report->cohort.reference);
  ASSERT_EQ(components[kFocal].name, "cam0.focal.x");
  EXPECT_EQ(report->cohort.devices.size(), static_cast<std::size_t>(kDevices));
  EXPECT_NEAR(report->cohort.mu(kFocal), kMean_px, 0.1);
  EXPECT_NEAR(std::sqrt(report->cohort.S(kFocal, kFocal)), kSpread_px, 0.1);
  EXPECT_NEAR(report->quantiles(kFocal, 2), kMean_px, kSpread_px);
  ASSERT_EQ(report->outliers.size(), 1u);
  EXPECT_EQ(report->outliers[0].rig, "knocked");
  EXPECT_EQ(report->outliers[0].version, 2);
  EXPECT_LT(report->outliers[0].consistency.probability, 1e-4);
  EXPECT_EQ(report->outliers[0].consistency.components[0].component, kFocal);
  ASSERT_EQ(report->devices.size(), kDevices + 1u);
  EXPECT_EQ(report->devices[0].rig, "device0");
  EXPECT_EQ(report->devices.back().rig, "knocked");
  EXPECT_EQ(report->devices.back().version, 2);
  ASSERT_EQ(report->skipped.size(), 1u);
  EXPECT_EQ(report->skipped[0].rig, "new");
  EXPECT_THAT(report->skipped[0].reason, HasSubstr("factory"));
}

TEST_F(CohortReportTest, LooksAtSoManyRigsOnly) {
  for (const char* rig : {"a", "b", "c"}) CreateRig(rig);
  const auto some = DescribeCohort(store_.get(), {}, 2);
  ASSERT_TRUE(some.ok()) << some.status();
  EXPECT_EQ(some->rigs, 2);
  EXPECT_TRUE(some->truncated);
  const auto all = DescribeCohort(store_.get(), {}, 3);
  EXPECT_EQ(all->rigs, 3);
  EXPECT_FALSE(all->truncated);
  EXPECT_TRUE(all->cohort.devices.empty());
}

// About which its tolerances hold, the units of the statistics.
TEST_F(CohortReportTest, OffsetsAreFromThePriorMeanOfTheReference) {
  Rig rig = TestRig("a");
  rig.prior_mean = rig.factory;
  rig.prior_mean->cameras[0].f.x() += kMean_px;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto report = DescribeCohort(store_.get(), {}, 10);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->cohort.reference.cameras[0].f.x(),
            rig.prior_mean->cameras[0].f.x());
}

TEST_F(CohortReportTest, DevicesWithOtherCamerasDoNotCount) {
  CreateRig("a");
  Rig other = TestRig("b");
  other.factory.cameras.push_back(other.factory.cameras[0]);
  ASSERT_TRUE(domain_->CreateRig(other).ok());
  const auto report = DescribeCohort(store_.get(), {}, 10);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->reference.rig.id, "a");
  ASSERT_EQ(report->skipped.size(), 2u);
  EXPECT_THAT(report->skipped[1].reason, HasSubstr("cameras"));
}

TEST_F(CohortReportTest, OfNoRigThereIsNothingToSay) {
  EXPECT_TRUE(absl::IsNotFound(DescribeCohort(store_.get(), {}, 10).status()));
}

}  // namespace
}  // namespace selfcal::server
