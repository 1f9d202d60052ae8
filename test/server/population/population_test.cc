#include "server/population/population.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/population/estimate.h"
#include "proto/convert.h"
#include "selfcal/v1/fleet.pb.h"
#include "server/domain/alarms.h"
#include "test/server/pipeline/calibrated_devices.h"

namespace selfcal::server {
namespace {

constexpr int kFocal = 15 + 6;  // of camera 0: after the IMU and its pose
constexpr double kMean_px = 3;
constexpr double kSpread_px = 0.5;
constexpr std::int64_t kNow = 1'700'000'000'000'000'000;

class PopulationTest : public CalibratedDevices {
 protected:
  // A calibrated device with the label model=`model`.
  void Add(const std::string& rig, const std::string& model, double offset_px) {
    Calibrate(rig, offset_px);
    SetModel(rig, model);
  }

  void SetModel(const std::string& rig, const std::string& model) {
    const auto updated = domain_->UpdateRig(
        rig,
        [&](StoredRig stored) -> absl::StatusOr<StoredRig> {
          stored.labels["model"] = model;
          return stored;
        },
        "test");
    ASSERT_TRUE(updated.ok()) << updated.status();
  }

  // `count` devices, evenly about the mean.
  void AddMany(int count, const std::string& model) {
    for (int k = 0; k < count; ++k) {
      const double step =
          (k - 0.5 * (count - 1)) / std::sqrt((count * count - 1) / 12.0);
      Add(model + "-" + std::to_string(k), model, kMean_px + kSpread_px * step);
    }
  }

  int Update(std::int64_t now_ns = kNow, int sample = kCohortSample) {
    const auto stored = UpdateCohorts(
        &*domain_, "model", now_ns, [] { return false; }, sample);
    EXPECT_TRUE(stored.ok()) << stored.status();
    return stored.value_or(-1);
  }

  std::map<std::string, std::vector<Alarm>> WithAlarms() {
    RigQuery query;
    query.with_alarms = true;
    const auto listed = store_->ListRigSummaries(query, {100, ""});
    EXPECT_TRUE(listed.ok()) << listed.status();
    std::map<std::string, std::vector<Alarm>> alarms;
    if (!listed.ok()) return alarms;
    for (const RigSummary& rig : listed->items) {
      alarms[rig.rig] = AlarmsOf(rig, kNow);
    }
    return alarms;
  }

  std::vector<StoredCohort> Versions(const std::string& model) {
    const auto listed = store_->ListCohorts("model", model, {100, ""});
    EXPECT_TRUE(listed.ok()) << listed.status();
    return listed.ok() ? listed->items : std::vector<StoredCohort>();
  }
};

TEST_F(PopulationTest, VersionFollowsWhenTheDevicesHaveChanged) {
  AddMany(6, "t4");
  AddMany(5, "t5");
  CreateRig("without");
  EXPECT_EQ(Update(kNow), 2);
  EXPECT_EQ(Update(kNow + 1), 0);
  Add("late", "t4", kMean_px);
  EXPECT_EQ(Update(kNow + 2), 1);
  const auto versions = Versions("t4");
  ASSERT_EQ(versions.size(), 2u);
  EXPECT_EQ(versions[0].version, 2);
  EXPECT_EQ(versions[0].time_ns, kNow + 2);
  EXPECT_EQ(versions[1].time_ns, kNow);
  v1::Cohort cohort;
  ASSERT_TRUE(cohort.ParseFromString(versions[0].content));
  EXPECT_EQ(cohort.calibrated(), 7);
  EXPECT_EQ(cohort.devices_size(), 7);
  EXPECT_EQ(Versions("t5").size(), 1u);
  // A device that is recalibrated counts with its new version.
  const auto version = domain_->ActivateCalibration("late", 1, "eve", "test");
  ASSERT_TRUE(version.ok()) << version.status();
  EXPECT_EQ(Update(kNow + 3), 1);
  EXPECT_EQ(Versions("t4").size(), 3u);
}

TEST_F(PopulationTest, CohortWithoutCalibratedDevicesHasNoStatistics) {
  CreateRig("new");
  SetModel("new", "t4");
  EXPECT_EQ(Update(), 0);
  EXPECT_TRUE(Versions("t4").empty());
}

TEST_F(PopulationTest, TooFewDevicesGiveNoPrior) {
  AddMany(kLeastCohort - 1, "t4");
  EXPECT_EQ(Update(), 1);
  v1::Cohort cohort;
  ASSERT_TRUE(cohort.ParseFromString(Versions("t4").at(0).content));
  EXPECT_FALSE(cohort.estimated());
  EXPECT_FALSE(cohort.has_prior());
}

// The prior is a rig that can be created, about the mean of the devices, as
// certain as they are alike.
TEST_F(PopulationTest, PriorIsTheRigOfANewDevice) {
  constexpr int kDevices = 12;
  AddMany(kDevices, "t4");
  Add("knocked", "t4", kMean_px + 20 * kSpread_px);
  EXPECT_EQ(Update(), 1);
  v1::Cohort cohort;
  ASSERT_TRUE(cohort.ParseFromString(Versions("t4").at(0).content));
  ASSERT_TRUE(cohort.has_prior());
  EXPECT_EQ(cohort.outliers_size(), 1);
  EXPECT_TRUE(cohort.prior().name().empty());
  EXPECT_TRUE(cohort.prior().labels().empty());
  v1::Rig message = cohort.prior();
  message.set_name("rigs/new");
  StoredRig created;
  ASSERT_TRUE(FromProto(message, "", &created.rig).empty());
  ASSERT_TRUE(Validate(created.rig).empty());
  ASSERT_TRUE(domain_->CreateRig(created).ok());
  const Rig& rig = created.rig;
  EXPECT_NEAR(rig.factory.cameras[0].f.x(),
              TestRig("any").factory.cameras[0].f.x() + kMean_px,
              0.1);
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  // Of a draw about a mean of as many devices, at least; not much more, as the
  // spread is known from them alone.
  const double of_a_device = kSpread_px * std::sqrt(1 + 1.0 / kDevices);
  EXPECT_GT(sigmas(kFocal), 0.9 * of_a_device);
  EXPECT_LT(sigmas(kFocal), 1.6 * of_a_device);
  EXPECT_LT(sigmas(kFocal), 0.5 * PriorSigmas(TestRig("any"))(kFocal));
}

TEST_F(PopulationTest, RigThatContradictsItsCohortHasAnAlarm) {
  AddMany(8, "t4");
  Add("knocked", "t4", kMean_px + 20 * kSpread_px);
  EXPECT_TRUE(WithAlarms().empty());
  Update();
  const std::map<std::string, std::vector<Alarm>> expected = {
      {"knocked", {Alarm::kUnlikeCohort}}};
  EXPECT_EQ(WithAlarms(), expected);
  // Of the version, not of the rig.
  ASSERT_TRUE(domain_->ActivateCalibration("knocked", 1, "eve", "test").ok());
  EXPECT_TRUE(WithAlarms().empty());
  ASSERT_TRUE(domain_->ActivateCalibration("knocked", 2, "eve", "test").ok());
  EXPECT_EQ(WithAlarms(), expected);
  // In another cohort it contradicts nothing.
  SetModel("knocked", "t5");
  Update();
  EXPECT_TRUE(WithAlarms().empty());
  EXPECT_TRUE(store_->ListOutliers()->empty());
}

// A device that is switched off is not seen any more.
TEST_F(PopulationTest, RigsBeyondTheSampleAreComparedToo) {
  constexpr int kSample = 8;
  Add("knocked", "t4", kMean_px + 20 * kSpread_px);
  Add("bent", "t4", kMean_px - 20 * kSpread_px);
  Add("inside", "t4", kMean_px + 0.1);
  AddMany(kSample, "t4");
  Update(kNow, kSample);
  v1::Cohort cohort;
  ASSERT_TRUE(cohort.ParseFromString(Versions("t4").at(0).content));
  ASSERT_EQ(cohort.calibrated(), kSample);
  EXPECT_EQ(cohort.outliers_size(), 0);
  const std::map<std::string, std::vector<Alarm>> expected = {
      {"bent", {Alarm::kUnlikeCohort}}, {"knocked", {Alarm::kUnlikeCohort}}};
  EXPECT_EQ(WithAlarms(), expected);
}

TEST_F(PopulationTest, AlarmEndsByAComparisonAlone) {
  constexpr int kSample = 8;
  Add("knocked", "t4", kMean_px + 20 * kSpread_px);
  AddMany(kSample, "t4");
  Update();
  ASSERT_EQ(WithAlarms().size(), 1u);
  Update(kNow, kSample);  // it is not among those that were seen last
  EXPECT_EQ(WithAlarms().size(), 1u);
  SetModel("knocked", "t5");
  Update();
  EXPECT_TRUE(WithAlarms().empty());
}

TEST_F(PopulationTest, AlarmOfARigThatCannotBeComparedStays) {
  Rig other = TestRig("other");
  other.factory.cameras.push_back(other.factory.cameras[0]);
  ASSERT_TRUE(domain_->CreateRig(other).ok());
  SetModel("other", "t4");
  ASSERT_TRUE(domain_->NoteOutliers({{"other", 1}}, false).ok());
  ASSERT_EQ(WithAlarms().size(), 1u);
  AddMany(5, "t4");
  Update();
  EXPECT_EQ(WithAlarms().size(), 1u);
}

TEST_F(PopulationTest, ThreadDescribesCohortsUntilItIsStopped) {
  AddMany(5, "t4");
  Population off(&*domain_, {}, [] { return kNow; });
  off.Start();
  off.Stop();
  EXPECT_TRUE(Versions("t4").empty());
  Population population(&*domain_, {"model", 0.05}, [] { return kNow; });
  population.Start();
  EXPECT_TRUE(Eventually([&] { return Versions("t4").size() == 1; }));
  Add("late", "t4", kMean_px);
  EXPECT_TRUE(Eventually([&] { return Versions("t4").size() == 2; }));
  population.Stop();
}

}  // namespace
}  // namespace selfcal::server
