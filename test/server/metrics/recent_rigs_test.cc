#include "server/metrics/recent_rigs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(RecentRigs, ThoseThatSentLastAreKept) {
  RecentRigs rigs(2);
  rigs.Heard("c");
  rigs.Heard("b");
  EXPECT_THAT(rigs.List(), ElementsAre("b", "c"));
  rigs.Heard("c");
  rigs.Heard("a");
  EXPECT_THAT(rigs.List(), ElementsAre("a", "c"));
}

TEST(RecentRigs, NoneAreKeptWhereNoneAreWanted) {
  RecentRigs rigs(0);
  rigs.Heard("a");
  EXPECT_THAT(rigs.List(), IsEmpty());
}

TEST(GroupLabel, NamesOfClientsAreNotLabels) {
  EXPECT_EQ(GroupLabel("camera"), "camera");
  EXPECT_EQ(GroupLabel("joint"), "joint");
  EXPECT_EQ(GroupLabel("my-own"), "other");
}

}  // namespace
}  // namespace selfcal::server
