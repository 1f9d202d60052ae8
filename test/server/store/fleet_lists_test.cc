// Lists over all rigs: by time, page by page.
#include <algorithm>
#include <cmath>

#include "core/model/calibration.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

class FleetListsTest : public StoreTest {
 protected:
  static constexpr std::int64_t kTime = 1'700'000'000'000'000'000;

  // A run of the rig at this time, with its version.
  void Run(const std::string& id, std::int64_t time) {
    now_ns_ = kTime + time;
    const Rig rig = TestRig(id);
    if (!store_->GetRig(id).ok()) {
      ASSERT_TRUE(domain_->CreateRig(rig).ok());
      Put(id, 0);
      Score(rig, 0, 1.0);
    }
    const auto run = domain_->CreateManualRun(id, true);
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_TRUE(domain_->BeginRun(id, run->run).ok());
    const auto finished = domain_->FinishRun(
        id, run->run, TestCalibration(rig, *store_->GetRun(id, run->run)));
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  template <typename Fetch, typename Text>
  static std::vector<std::string> Pages(const Fetch& fetch, const Text& text) {
    std::vector<std::string> all;
    Page page{2, ""};
    do {
      const auto listed = fetch(page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      for (const auto& item : listed->items) all.push_back(text(item));
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }
};
SELFCAL_STORE_TEST_SUITE(FleetListsTest);

TEST_P(FleetListsTest, RunsAndVersionsOfAllRigsGoByTime) {
  Run("b", 1);
  Run("a", 2);
  Run("c", 3);
  Run("a", 4);
  Run("b", 4);  // at the same time
  const auto runs = Pages(
      [&](const Page& page) { return store_->ListRuns("", page); },
      [](const StoredRun& run) { return run.rig + std::to_string(run.run); });
  ASSERT_THAT(runs, SizeIs(5));
  EXPECT_THAT(std::vector<std::string>(runs.begin(), runs.begin() + 2),
              ::testing::UnorderedElementsAre("a2", "b2"));
  EXPECT_THAT(std::vector<std::string>(runs.begin() + 2, runs.end()),
              ElementsAre("c1", "a1", "b1"));
  const auto versions = Pages(
      [&](const Page& page) { return store_->ListCalibrations("", page); },
      [](const StoredCalibration& version) {
        return version.rig + std::to_string(version.version);
      });
  // With the factory's version of each rig, at the time of its first run.
  ASSERT_THAT(versions, SizeIs(8));
  EXPECT_THAT(std::vector<std::string>(versions.begin() + 2, versions.end()),
              ElementsAre("c2", "c1", "a2", "a1", "b2", "b1"));
}

TEST_P(FleetListsTest, ParametersGoByRigAndVersion) {
  Run("a", 1);
  Run("b", 2);
  Run("a", 3);
  const auto all = [&](const EstimateQuery& query) {
    return Pages(
        [&](const Page& page) { return store_->ListEstimates(query, page); },
        [](const StoredEstimate& estimate) {
          return estimate.rig + std::to_string(estimate.version) + " " +
                 estimate.component;
        });
  };
  const auto components = TangentComponents(TestRig("a").factory);
  EXPECT_THAT(all({}), SizeIs(5 * components.size()));
  EstimateQuery query;
  query.component = components[3].name;
  query.rigs.name = "a";
  EXPECT_THAT(all(query),
              ElementsAre("a1 " + query.component,
                          "a2 " + query.component,
                          "a3 " + query.component));
  query.only_active = true;
  query.rigs.name = "";
  EXPECT_THAT(all(query),
              ::testing::UnorderedElementsAre("a3 " + query.component,
                                              "b2 " + query.component));
  query.rigs.labels = {{"model", "t4"}};
  EXPECT_THAT(all(query), SizeIs(0));
  ASSERT_TRUE(domain_
                  ->UpdateRig(
                      "b",
                      [](StoredRig rig) -> absl::StatusOr<StoredRig> {
                        rig.labels["model"] = "t4";
                        return rig;
                      },
                      "eve")
                  .ok());
  EXPECT_THAT(all(query), ElementsAre("b2 " + query.component));
}

TEST_P(FleetListsTest, ParametersAreThoseOfTheVersion) {
  Run("a", 1);
  const auto active = store_->GetActiveCalibration("a");
  ASSERT_TRUE(active.ok()) << active.status();
  EstimateQuery query;
  query.only_active = true;
  const auto listed = store_->ListEstimates(query, {100, ""});
  ASSERT_TRUE(listed.ok()) << listed.status();
  const auto components = TangentComponents(active->theta);
  const Eigen::VectorXd values = ReadableValues(active->theta);
  ASSERT_THAT(listed->items, SizeIs(components.size()));
  for (const StoredEstimate& estimate : listed->items) {
    const auto found = std::find_if(
        components.begin(), components.end(), [&](const auto& component) {
          return component.name == estimate.component;
        });
    ASSERT_NE(found, components.end());
    const auto i = found - components.begin();
    EXPECT_EQ(estimate.value, values[i]);
    EXPECT_EQ(estimate.sigma, std::sqrt(active->covariance(i, i)));
    EXPECT_EQ(estimate.from_factory, 0.0);  // TestCalibration is the factory's
    EXPECT_EQ(estimate.unit, found->unit);
    EXPECT_EQ(estimate.state, CalibrationState::kActive);
  }
}

TEST_P(FleetListsTest, ParametersOfNoRigAreNotFound) {
  EstimateQuery query;
  query.rigs.name = "nobody";
  EXPECT_TRUE(absl::IsNotFound(store_->ListEstimates(query, {}).status()));
}

TEST_P(FleetListsTest, ATokenIsOfItsList) {
  Run("a", 1);
  Run("b", 2);
  const auto all = store_->ListRuns("", {1, ""});
  ASSERT_TRUE(all.ok()) << all.status();
  ASSERT_FALSE(all->next_token.empty());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListRuns("a", {1, all->next_token}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCalibrations("", {1, all->next_token}).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListRuns("", {1, "nonsense"}).status()));
}

TEST_P(FleetListsTest, DamagedVersionsDoNotHideOthers) {
  Run("a", 1);
  domain_.reset();
  store_.reset();
  ASSERT_TRUE(GetParam().damage(folder_, "calibrations", "content").ok());
  Reopen();
  Run("b", 2);
  const auto listed = store_->ListCalibrations("", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  for (const StoredCalibration& version : listed->items) {
    EXPECT_EQ(version.rig, "b");
  }
  EXPECT_THAT(listed->items, SizeIs(2));
}

}  // namespace
}  // namespace selfcal::server
