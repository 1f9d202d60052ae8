// Records of the statistics of cohorts.
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class CohortsTest : public StoreTest {
 protected:
  std::int64_t Put(const std::string& value, std::int64_t kept = 100) {
    const auto version =
        store_->PutCohort({"model", value, 0, ++time_, "of " + value}, kept);
    EXPECT_TRUE(version.ok()) << version.status();
    return version.value_or(-1);
  }

  // value:version, page by page.
  std::vector<std::string> List(const std::string& label,
                                const std::string& value) {
    std::vector<std::string> all;
    Page page{2, ""};
    do {
      const auto listed = store_->ListCohorts(label, value, page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      for (const StoredCohort& cohort : listed->items) {
        EXPECT_EQ(cohort.label, "model");
        EXPECT_EQ(cohort.content, "of " + cohort.value);
        all.push_back(cohort.value + ":" + std::to_string(cohort.version));
      }
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }

 private:
  std::int64_t time_ = 0;
};
SELFCAL_STORE_TEST_SUITE(CohortsTest);

TEST_P(CohortsTest, ListsTheNewestOfEachOrAllOfOne) {
  EXPECT_THAT(List("", ""), ElementsAre());
  for (const std::string value : {"t5", "t4", "a = b", "t4", "t4"}) Put(value);
  EXPECT_THAT(List("", ""), ElementsAre("a = b:1", "t4:3", "t5:1"));
  EXPECT_THAT(List("model", "t4"), ElementsAre("t4:3", "t4:2", "t4:1"));
  EXPECT_THAT(List("model", "none"), ElementsAre());
}

TEST_P(CohortsTest, KeepsTheNewestVersions) {
  for (int k = 1; k <= 5; ++k) EXPECT_EQ(Put("t4", 2), k);
  EXPECT_THAT(List("model", "t4"), ElementsAre("t4:5", "t4:4"));
}

TEST_P(CohortsTest, ATokenIsOfItsList) {
  for (const std::string value : {"t4", "t4", "t5"}) Put(value);
  const auto newest = store_->ListCohorts("", "", {1, ""});
  ASSERT_TRUE(newest.ok()) << newest.status();
  ASSERT_FALSE(newest->next_token.empty());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCohorts("model", "t4", {1, newest->next_token}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCohorts("", "", {1, "nonsense"}).status()));
}

TEST_P(CohortsTest, ValuesOfALabelAreThoseOfRigs) {
  for (const std::string id : {"a", "b", "c", "d"}) {
    StoredRig stored;
    stored.rig = TestRig(id);
    if (id != "d") stored.labels["model"] = id == "b" ? "t5" : "t4";
    stored.labels["site"] = id;
    ASSERT_TRUE(domain_->CreateRig(stored).ok());
  }
  const auto values = store_->ListLabelValues("model");
  ASSERT_TRUE(values.ok()) << values.status();
  EXPECT_THAT(*values, ElementsAre("t4", "t5"));
  EXPECT_TRUE(store_->ListLabelValues("other")->empty());
}

TEST_P(CohortsTest, DamageIsFound) {
  Put("t4");
  domain_.reset();
  store_.reset();
  ASSERT_TRUE(GetParam().damage(folder_, "cohorts", "content").ok());
  Reopen();
  EXPECT_TRUE(absl::IsDataLoss(store_->ListCohorts("", "", {}).status()));
}

}  // namespace
}  // namespace selfcal::server
