#include "server/pipeline/other_replicas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace selfcal::server {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Beats of 1 s, and a lease of 10 s.
class OtherReplicasTest : public ::testing::Test {
 protected:
  // An update at that time of the replica "own".
  OtherReplicas::Summary Update(int time_s,
                                const std::vector<ReplicaRecord>& others) {
    std::vector<ReplicaRecord> records = {{"own", time_s}};
    records.insert(records.end(), others.begin(), others.end());
    return others_.Update(
        "own", records, OtherReplicas::Clock::time_point(seconds(time_s)));
  }
  std::vector<std::string> Silent(int time_s,
                                  const std::vector<ReplicaRecord>& others) {
    std::vector<std::string> names;
    for (const auto& record : Update(time_s, others).silent) {
      names.push_back(record.replica);
    }
    return names;
  }

  OtherReplicas others_{{.shared = true, .beat = seconds(1)}};
};

TEST_F(OtherReplicasTest, OneIsSilentWhoseBeatHasNotGrownForTheLease) {
  for (int time_s = 100; time_s <= 110; ++time_s) {
    EXPECT_THAT(Silent(time_s, {{"dead", 7}, {"living", time_s}}), IsEmpty());
  }
  EXPECT_THAT(Silent(111, {{"dead", 7}, {"living", 111}}), ElementsAre("dead"));
  // Its record could not be removed.
  EXPECT_THAT(Silent(112, {{"dead", 7}, {"living", 112}}), ElementsAre("dead"));
  EXPECT_THAT(Silent(113, {{"dead", 8}, {"living", 113}}), IsEmpty())
      << "it was not dead";
}

TEST_F(OtherReplicasTest, NobodyIsSilentAfterAGapInTheUpdates) {
  Update(100, {{"other", 7}});
  EXPECT_THAT(Silent(120, {{"other", 7}}), IsEmpty());
  for (int time_s = 121; time_s <= 130; ++time_s) {
    EXPECT_THAT(Silent(time_s, {{"other", 7}}), IsEmpty());
  }
  EXPECT_THAT(Silent(131, {{"other", 7}}), ElementsAre("other"));
}

TEST_F(OtherReplicasTest, TheFirstNameOfThoseThatAreNotSilentIsFirst) {
  EXPECT_TRUE(Update(100, {}).is_first);
  EXPECT_TRUE(Update(101, {{"z", 1}}).is_first);
  for (int time_s = 102; time_s <= 112; ++time_s) {
    EXPECT_FALSE(Update(time_s, {{"a", 1}, {"z", time_s}}).is_first);
  }
  EXPECT_TRUE(Update(113, {{"a", 1}, {"z", 113}}).is_first);
}

TEST_F(OtherReplicasTest, NothingIsKnownAfterClear) {
  for (int time_s = 100; time_s <= 110; ++time_s) Update(time_s, {{"dead", 7}});
  others_.Clear();
  EXPECT_THAT(Silent(111, {{"dead", 7}}), IsEmpty());
}

}  // namespace
}  // namespace selfcal::server
