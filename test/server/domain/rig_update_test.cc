// What of a rig can change, and what follows.
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

class RigUpdateTest : public StoreTest {
 protected:
  RigUpdateTest() {
    rig_ = TestRig("a");
    EXPECT_TRUE(domain_->CreateRig(rig_).ok());
  }

  absl::StatusOr<RigUpdate> Update(
      const std::function<void(StoredRig*)>& change) {
    return domain_->UpdateRig(
        "a",
        [&](const StoredRig& before) -> absl::StatusOr<StoredRig> {
          StoredRig after = before;
          change(&after);
          return after;
        },
        "eve");
  }

  Rig rig_;
};

SELFCAL_STORE_TEST_SUITE(RigUpdateTest);

TEST_P(RigUpdateTest, LabelsAreKeptAndReplaced) {
  ASSERT_TRUE(Update([](StoredRig* rig) {
                rig->labels = {{"batch", "7"}};
              }).ok());
  EXPECT_THAT(store_->GetRig("a")->labels, ElementsAre(Pair("batch", "7")));
  const auto update = Update([](StoredRig* rig) {
    rig->labels = {{"site", "roof"}};
  });
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_FALSE(update->rescore);
  EXPECT_THAT(store_->GetRig("a")->labels, ElementsAre(Pair("site", "roof")));
  const auto events = store_->ListNewestEvents({1, ""}, "a");
  EXPECT_EQ(events->items.at(0).kind, EventKind::kRigUpdated);
  EXPECT_THAT(events->items.at(0).detail, HasSubstr("eve"));
}

TEST_P(RigUpdateTest, RigsAreFoundByTheirLabels) {
  ASSERT_TRUE(domain_->CreateRig(TestRig("b")).ok());
  ASSERT_TRUE(Update([](StoredRig* rig) {
                rig->labels = {{"batch", "7"}, {"site", "roof"}};
              }).ok());
  const auto found = [&](const std::map<std::string, std::string>& labels,
                         const std::string& text = "") {
    std::vector<std::string> names;
    const auto rigs =
        store_->ListRigs({.text = text, .labels = labels}, Page());
    const auto summaries =
        store_->ListRigSummaries({.text = text, .labels = labels}, Page());
    EXPECT_TRUE(rigs.ok() && summaries.ok());
    EXPECT_EQ(rigs->items.size(), summaries->items.size());
    for (const StoredRig& rig : rigs->items) names.push_back(rig.rig.id);
    return names;
  };
  EXPECT_THAT(found({}), ElementsAre("a", "b"));
  EXPECT_THAT(found({{"batch", "7"}}), ElementsAre("a"));
  EXPECT_THAT(found({{"batch", "7"}, {"site", "roof"}}), ElementsAre("a"));
  EXPECT_THAT(found({{"batch", "7"}, {"site", "cellar"}}), ElementsAre());
  EXPECT_THAT(found({{"batch", "70"}}), ElementsAre());
  EXPECT_THAT(found({{"batch", "7"}}, "b"), ElementsAre());
}

TEST_P(RigUpdateTest, OtherTolerancesCallForNewScores) {
  const auto update = Update([](StoredRig* rig) {
    rig->rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.001});
  });
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_TRUE(update->rescore);
  EXPECT_EQ(PriorSigmas(store_->GetRig("a")->rig),
            PriorSigmas(update->rig.rig));
}

// Scores depend on the sigmas of the prior alone.
TEST_P(RigUpdateTest, AnotherPriorMeanNeedsNoNewScores) {
  Calibration mean = rig_.factory;
  mean.cameras[0].f.x() += 1;
  const auto update = domain_->UpdateRig(
      "a",
      [&](StoredRig rig) -> absl::StatusOr<StoredRig> {
        rig.rig.prior_mean = mean;
        return rig;
      },
      "eve",
      "as its cohort");
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_FALSE(update->rescore);
  const auto events = store_->ListNewestEvents({1, ""}, "a");
  EXPECT_EQ(events->items.at(0).kind, EventKind::kRigUpdated);
  EXPECT_EQ(events->items.at(0).detail, "changed by eve: as its cohort");
  Reopen();
  ASSERT_TRUE(store_->GetRig("a")->rig.prior_mean.has_value());
  ExpectSameCalibration(*store_->GetRig("a")->rig.prior_mean, mean);
  // Version 1 remains the factory calibration.
  ExpectSameCalibration(store_->GetActiveCalibration("a")->theta, rig_.factory);
  ASSERT_TRUE(Update([](StoredRig* rig) { rig->rig.prior_mean.reset(); }).ok());
  EXPECT_FALSE(store_->GetRig("a")->rig.prior_mean.has_value());
}

TEST_P(RigUpdateTest, DeviceAndWhatIsComputedWithItStay) {
  const std::vector<std::function<void(StoredRig*)>> changes = {
      [](StoredRig* rig) { rig->rig.factory.imu.s_g.x() += 0.01; },
      [](StoredRig* rig) { rig->rig.pixel_sigma_px *= 2; },
      [](StoredRig* rig) { rig->rig.imu_noise.gyro_noise_density *= 2; },
      [](StoredRig* rig) { rig->rig.table_size += 1; },
      [](StoredRig* rig) { rig->rig.groups.pop_back(); },
      [](StoredRig* rig) { rig->rig.id = "b"; },
  };
  const auto events = store_->ListEvents(Page(), "a")->items.size();
  for (const auto& change : changes) {
    EXPECT_TRUE(absl::IsInvalidArgument(Update(change).status()));
  }
  EXPECT_EQ(store_->ListEvents(Page(), "a")->items.size(), events);
  EXPECT_EQ(store_->GetRig("a")->rig.table_size, rig_.table_size);
}

TEST_P(RigUpdateTest, NoChangeLeavesNoEvent) {
  const auto events = store_->ListEvents(Page(), "a")->items.size();
  EXPECT_TRUE(Update([](StoredRig*) {}).ok());
  EXPECT_EQ(store_->ListEvents(Page(), "a")->items.size(), events);
}

}  // namespace
}  // namespace selfcal::server
