#include "core/model/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Rig RandomRig() {
  RandomValues random(1);
  Rig rig;
  rig.id = "phone-1";
  rig.factory = random.Theta();
  return rig;
}

std::vector<std::string> Matched(const Rig& rig, const std::string& pattern) {
  const auto components = TangentComponents(rig.factory);
  std::vector<std::string> names;
  for (const int i : MatchComponents(components, {pattern})) {
    names.push_back(components[i].name);
  }
  return names;
}

TEST(MatchComponents, NameMatchesItselfAlone) {
  EXPECT_THAT(Matched(RandomRig(), "cam0.focal.x"),
              ElementsAre("cam0.focal.x"));
  EXPECT_THAT(Matched(RandomRig(), "cam0.focal"), IsEmpty());
  EXPECT_THAT(Matched(RandomRig(), ""), IsEmpty());
}

TEST(MatchComponents, StarStandsForAnythingAtEitherEnd) {
  const Rig rig = RandomRig();
  EXPECT_THAT(Matched(rig, "cam0.p_CI.*"),
              ElementsAre("cam0.p_CI.x", "cam0.p_CI.y", "cam0.p_CI.z"));
  EXPECT_THAT(Matched(rig, "*.focal.x"),
              ElementsAre("cam0.focal.x", "cam1.focal.x", "cam2.focal.x"));
  EXPECT_THAT(
      Matched(rig, "*accel.scale*"),
      ElementsAre(
          "imu.accel.scale.x", "imu.accel.scale.y", "imu.accel.scale.z"));
  EXPECT_EQ(static_cast<int>(Matched(rig, "*").size()),
            TangentSize(rig.factory));
  EXPECT_EQ(static_cast<int>(Matched(rig, "**").size()),
            TangentSize(rig.factory));
}

TEST(MatchComponents, StarInTheMiddleMatchesNothing) {
  EXPECT_THAT(Matched(RandomRig(), "cam0.*.x"), IsEmpty());
}

TEST(MatchComponents, SeveralPatternsGiveEachComponentOnceInOrder) {
  const Rig rig = RandomRig();
  const std::vector<int> matched =
      MatchComponents(TangentComponents(rig.factory),
                      {"*.q_CI.*", "imu.gyro.*", "imu.gyro.scale.x", "cam0.*"});
  EXPECT_TRUE(std::is_sorted(matched.begin(), matched.end()));
  EXPECT_EQ(std::adjacent_find(matched.begin(), matched.end()), matched.end());
  EXPECT_EQ(matched.size(), 6u + 11 + 3 + 3);
}

TEST(DefaultGroups, CoverTheTangentExactlyOnce) {
  const Rig rig = RandomRig();
  std::vector<int> all;
  std::vector<std::string> names;
  for (const ParameterGroup& group : rig.groups) {
    names.push_back(group.name);
    for (const int i : GroupComponents(rig, group)) all.push_back(i);
  }
  EXPECT_THAT(names, ElementsAre("imu", "camera", "extrinsics"));
  std::sort(all.begin(), all.end());
  ASSERT_EQ(static_cast<int>(all.size()), TangentSize(rig.factory));
  for (int i = 0; i < TangentSize(rig.factory); ++i) EXPECT_EQ(all[i], i);
}

TEST(FixedComponents, AreInNoGroupAndNotFree) {
  Rig rig = RandomRig();
  rig.fixed = {"imu.gyro.*", "cam1.principal.y"};
  const auto components = TangentComponents(rig.factory);
  const auto expect_free = [&](const std::vector<int>& indices) {
    for (const int i : indices) {
      EXPECT_FALSE(components[i].name.starts_with("imu.gyro."));
      EXPECT_NE(components[i].name, "cam1.principal.y");
    }
  };
  EXPECT_EQ(GroupComponents(rig, rig.groups[0]).size(), 9u);
  for (const ParameterGroup& group : rig.groups) {
    expect_free(GroupComponents(rig, group));
  }
  expect_free(FreeComponents(rig));
  EXPECT_EQ(FreeComponents(rig).size(), components.size() - 7);
}

TEST(PriorSigmas, AreTenReferenceSigmasWithoutASetting) {
  const Rig rig = RandomRig();
  EXPECT_EQ(PriorSigmas(rig), 10 * ReferenceSigmas(rig));
}

TEST(PriorSigmas, LaterSettingsWin) {
  Rig rig = RandomRig();
  rig.prior_sigmas = {
      {"*.focal.*", 20}, {"cam1.focal.x", 5}, {"imu.q_AI.*", 0.01}};
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  const auto components = TangentComponents(rig.factory);
  for (std::size_t i = 0; i < components.size(); ++i) {
    const std::string& name = components[i].name;
    double expected = 10 * components[i].sigma_ref;
    if (name.find(".focal.") != name.npos) expected = 20;
    if (name == "cam1.focal.x") expected = 5;
    if (name.starts_with("imu.q_AI.")) expected = 0.01;
    EXPECT_EQ(sigmas[static_cast<int>(i)], expected) << name;
  }
}

}  // namespace
}  // namespace selfcal
