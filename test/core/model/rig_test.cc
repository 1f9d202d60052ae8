#include "core/model/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/model/parameter_blocks.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Not;

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
  EXPECT_EQ(matched.size(), 6u + 12 + 3 + 3);
}

// Names of the groups, and all of their components, sorted.
struct AllGroups {
  explicit AllGroups(const Rig& rig) {
    for (const ParameterGroup& group : rig.groups) {
      names.push_back(group.name);
      for (const int i : GroupComponents(rig, group)) components.push_back(i);
    }
    std::sort(components.begin(), components.end());
  }
  std::vector<std::string> names;
  std::vector<int> components;
};

TEST(DefaultGroups, CoverAllThatIsEstimatedExactlyOnce) {
  const Rig rig = RandomRig();
  const AllGroups groups(rig);
  EXPECT_THAT(groups.names, ElementsAre("imu", "camera", "extrinsics"));
  EXPECT_EQ(groups.components, FreeComponents(rig));
}

TEST(DefaultGroups, HaveTimeOffsetsInOneOfTheirOwnWhereTheyAreEstimated) {
  Rig rig = RandomRig();
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks);
  const AllGroups groups(rig);
  EXPECT_THAT(groups.names, ElementsAre("imu", "camera", "extrinsics", "time"));
  EXPECT_EQ(groups.components, FreeComponents(rig));
  EXPECT_EQ(static_cast<int>(groups.components.size()),
            TangentSize(rig.factory));
  EXPECT_THAT(GroupComponents(rig, rig.groups[3]),
              ElementsAre(TimeOffsetComponent(rig.factory, 0),
                          TimeOffsetComponent(rig.factory, 1),
                          TimeOffsetComponent(rig.factory, 2)));
}

TEST(DefaultGroups, HaveTheLineDelayOfARollingShutterWithTheTimes) {
  Rig rig = RandomRig();
  rig.factory.cameras[1].line_delay_s = 3e-5;
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  ASSERT_EQ(rig.groups.size(), 4u);
  EXPECT_EQ(rig.groups[3].name, "time");
  EXPECT_THAT(GroupComponents(rig, rig.groups[3]),
              ElementsAre(TimeOffsetComponent(rig.factory, 1) + 1));
}

TEST(EstimatedBlocks, AreAddedToANewRigThatLacksThem) {
  Calibration theta = RandomRig().factory;
  AddEstimatedBlocks({}, &theta);
  AddEstimatedBlocks({{"*.time_offset", true}, {"imu.*", false}}, &theta);
  for (const CameraCalibration& camera : theta.cameras) {
    EXPECT_FALSE(camera.line_delay_s);
  }
  AddEstimatedBlocks({{"cam1.line_delay", true}}, &theta);
  EXPECT_FALSE(theta.cameras[0].line_delay_s);
  EXPECT_EQ(theta.cameras[1].line_delay_s, 0);
  theta.cameras[1].line_delay_s = 3e-5;
  AddEstimatedBlocks({{"*.line_delay", true}, {"cam2.*", false}}, &theta);
  EXPECT_EQ(theta.cameras[0].line_delay_s, 0);
  EXPECT_EQ(theta.cameras[1].line_delay_s, 3e-5);
  EXPECT_FALSE(theta.cameras[2].line_delay_s);
}

TEST(TimeOffsets, AreKnownUnlessTheRigEstimatesThem) {
  Rig rig = RandomRig();
  const auto free = [&](int camera) {
    const std::vector<int> all = FreeComponents(rig);
    return std::binary_search(
        all.begin(), all.end(), TimeOffsetComponent(rig.factory, camera));
  };
  for (int j = 0; j < 3; ++j) EXPECT_FALSE(free(j));
  EXPECT_THAT(EstimatedTimeOffsets(rig), ElementsAre(0, 0, 0));
  rig.blocks = {{"*.time_offset", true}};
  EXPECT_THAT(EstimatedTimeOffsets(rig), ElementsAre(1, 1, 1));
  // Time offset of the camera relative to which the others are estimated.
  rig.fixed = {"cam0.time_offset"};
  EXPECT_FALSE(free(0));
  EXPECT_TRUE(free(1));
  EXPECT_THAT(EstimatedTimeOffsets(rig), ElementsAre(0, 1, 1));
}

// Names of the blocks with a free component.
std::vector<std::string> FreeBlocks(const Rig& rig) {
  const std::vector<std::string> blocks = ComponentBlocks(rig.factory);
  std::vector<std::string> free;
  for (const int i : FreeComponents(rig)) {
    if (free.empty() || free.back() != blocks[i]) free.push_back(blocks[i]);
  }
  return free;
}

TEST(Blocks, AreEstimatedAsTheLastSettingThatMatchesStates) {
  Rig rig = RandomRig();
  rig.blocks = {{"*", false},
                {"imu.accel.*", true},
                {"imu.accel.scale", false},
                {"cam2.time_offset", true}};
  EXPECT_THAT(FreeBlocks(rig),
              ElementsAre("imu.accel.misalignment", "cam2.time_offset"));
  EXPECT_THAT(EstimatedTimeOffsets(rig), ElementsAre(0, 0, 1));
  rig.fixed = {"imu.accel.misalignment.*"};
  EXPECT_THAT(FreeBlocks(rig), ElementsAre("cam2.time_offset"));
}

TEST(Blocks, OfAnImuAreAddedWhereASettingEstimatesThem) {
  Rig rig = RandomRig();
  rig.blocks = {{"imu.gyro.*", true}, {"imu.accel.position", false}};
  AddEstimatedBlocks(rig.blocks, &rig.factory);
  EXPECT_EQ(rig.factory.imu.gyro_g_sensitivity, Eigen::VectorXd::Zero(9));
  EXPECT_EQ(rig.factory.imu.accel_position.size(), 0);
  rig.blocks = {{"imu.accel.position", true}};
  AddEstimatedBlocks(rig.blocks, &rig.factory);
  EXPECT_EQ(rig.factory.imu.accel_position, Eigen::VectorXd::Zero(9));
  // Both are there; one is estimated.
  EXPECT_THAT(FreeBlocks(rig), Contains("imu.accel.position"));
  EXPECT_THAT(FreeBlocks(rig), Not(Contains("imu.gyro.g_sensitivity")));
  rig.factory.imu.accel_position = Eigen::Vector3d(1, 2, 3);
  AddEstimatedBlocks(rig.blocks, &rig.factory);
  EXPECT_EQ(rig.factory.imu.accel_position, Eigen::Vector3d(1, 2, 3));
}

TEST(DefaultGroups, LeaveOutWhatHasNoEstimatedBlock) {
  Rig rig = RandomRig();
  rig.blocks = {{"imu.*", false}, {"*CI", false}, {"cam2.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, 3);
  const AllGroups groups(rig);
  EXPECT_THAT(groups.names, ElementsAre("camera", "time"));
  EXPECT_EQ(groups.components, FreeComponents(rig));
  EXPECT_EQ(DefaultGroups(rig.blocks, 2).size(), 1u);
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
  // And the time offsets.
  EXPECT_EQ(FreeComponents(rig).size(), components.size() - 7 - 3);
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

TEST(PriorMean, IsTheFactoryCalibrationUnlessTheRigHasOne) {
  Rig rig = RandomRig();
  EXPECT_EQ(&PriorMean(rig), &rig.factory);
  rig.prior_mean = rig.factory;
  rig.prior_mean->cameras[0].f.x() += 1;
  EXPECT_EQ(PriorMean(rig).cameras[0].f.x(), rig.factory.cameras[0].f.x() + 1);
}

}  // namespace
}  // namespace selfcal
