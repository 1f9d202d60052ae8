#include "server/pipeline/arriving_rigs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(ArrivingRigs, AreTakenOnceHoweverManySegmentsArrive) {
  ArrivingRigs rigs;
  EXPECT_TRUE(rigs.Note("b"));
  EXPECT_TRUE(rigs.Note("a"));
  EXPECT_TRUE(rigs.Note("b"));
  EXPECT_THAT(rigs.Take(), ElementsAre("a", "b"));
  EXPECT_THAT(rigs.Take(), IsEmpty());
}

TEST(ArrivingRigs, ThoseOfOthersAreLookedAtAgainAfterTheNextBeat) {
  ArrivingRigs rigs;
  rigs.NoteForeign({"a"});
  EXPECT_FALSE(rigs.Note("a"));
  EXPECT_TRUE(rigs.Note("b"));
  EXPECT_THAT(rigs.Take(), ElementsAre("b"));
  rigs.ForgetForeign();
  EXPECT_TRUE(rigs.Note("a"));
  EXPECT_THAT(rigs.Take(), ElementsAre("a"));
}

}  // namespace
}  // namespace selfcal::server
