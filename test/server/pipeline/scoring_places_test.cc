#include "server/pipeline/scoring_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class ScoringPlacesTest : public ::testing::Test {
 protected:
  // Places that the rig can take without waiting.
  int Free(const std::string& rig) {
    int taken = 0;
    for (bool gone = false; !gone;) {
      const absl::Status status =
          places_.Take(rig, [&] { return std::exchange(gone, true); });
      if (status.ok()) ++taken;
    }
    for (int k = 0; k < taken; ++k) places_.Return(rig);
    return taken;
  }

  ScoringPlaces places_{4};
};

TEST_F(ScoringPlacesTest, APlaceIsFreeOnceItsSegmentIsScored) {
  places_.Open({{"a", 3}});
  EXPECT_THAT(places_.FilledRigs(), ElementsAre("a"));
  EXPECT_EQ(Free("a"), 1);
  ASSERT_TRUE(places_.Take("a", nullptr).ok());
  places_.Fill("a");
  EXPECT_EQ(Free("a"), 0);
  places_.Empty("a", 1);
  EXPECT_EQ(Free("a"), 1);
  places_.Empty("a", 3);
  EXPECT_EQ(Free("a"), 4);
  EXPECT_THAT(places_.FilledRigs(), IsEmpty());
}

TEST_F(ScoringPlacesTest, APlaceThatIsNotFilledYetIsNotEmptied) {
  places_.Open({{"a", 2}});
  ASSERT_TRUE(places_.Take("a", nullptr).ok());
  places_.EmptyAllBut("a", 1);
  EXPECT_EQ(Free("a"), 2) << "one is unscored, one about to be stored";
  places_.EmptyAllBut("a", 2);
  EXPECT_EQ(Free("a"), 2) << "another daemon has stored one";
  places_.EmptyAllBut("a", 0);
  EXPECT_EQ(Free("a"), 3);
  EXPECT_THAT(places_.FilledRigs(), IsEmpty());
  places_.EmptyAllBut("unknown", 0);
}

TEST_F(ScoringPlacesTest, OpenForgetsThePlacesOfBefore) {
  places_.Open({{"a", 3}});
  places_.Close();
  EXPECT_TRUE(absl::IsUnavailable(places_.Take("a", nullptr)));
  places_.Open({{"b", 1}});
  EXPECT_THAT(places_.FilledRigs(), ElementsAre("b"));
  EXPECT_EQ(Free("a"), 3);
}

}  // namespace
}  // namespace selfcal::server
