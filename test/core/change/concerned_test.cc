#include "core/change/concerned.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

using ::testing::ElementsAreArray;
using ::testing::IsEmpty;

TEST(Concerned, AComponentOfTwoGroupsIsConcernedByEither) {
  Rig rig = HandheldRig("a");
  rig.groups.push_back({"position", {"*.p_CI.*"}});
  const auto components = TangentComponents(rig.factory);
  EXPECT_THAT(
      ConcernedComponents(rig, {"position", "extrinsics"}),
      ElementsAreArray(MatchComponents(components, {"*.q_CI.*", "*.p_CI.*"})));
  EXPECT_THAT(ConcernedComponents(rig, {"position"}),
              ElementsAreArray(MatchComponents(components, {"*.p_CI.*"})));
}

TEST(Concerned, TheOthersAreAllElseThatIsEstimated) {
  Rig rig = HandheldRig("a");
  rig.fixed = {"imu.gyro.*"};
  EXPECT_THAT(UnconcernedComponents(rig, {"extrinsics"}),
              ElementsAreArray(MatchComponents(TangentComponents(rig.factory),
                                               {"imu.accel.*",
                                                "imu.q_AI.*",
                                                "*.focal.*",
                                                "*.principal.*",
                                                "*.distortion.*"})));
}

TEST(Concerned, OfNoGroupIsNothing) {
  const Rig rig = HandheldRig("a");
  EXPECT_THAT(ConcernedComponents(rig, {}), IsEmpty());
  EXPECT_THAT(UnconcernedComponents(rig, {}),
              ElementsAreArray(FreeComponents(rig)));
}

}  // namespace
}  // namespace selfcal
