#include "core/change/parameter_blocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

TEST(ParameterBlocks, AreAllGroupsAndTheirParts) {
  std::vector<std::string> names;
  for (const ParameterBlock& block : ParameterBlocks(HandheldRig("a"))) {
    names.push_back(block.name);
    const auto k = block.basis.cols();
    EXPECT_LT((block.basis.transpose() * block.basis -
               Eigen::MatrixXd::Identity(k, k))
                  .norm(),
              1e-12)
        << block.name;
  }
  EXPECT_THAT(names,
              ::testing::UnorderedElementsAre("all",
                                              "imu",
                                              "camera",
                                              "extrinsics",
                                              "imu.gyro.scale",
                                              "imu.gyro.misalignment",
                                              "imu.accel.scale",
                                              "imu.accel.misalignment",
                                              "imu.q_AI",
                                              "cam0.q_CI",
                                              "cam0.p_CI",
                                              "cam0.focal",
                                              "cam0.zoom",
                                              "cam0.principal",
                                              "cam0.distortion"));
}

TEST(ParameterBlocks, LeaveOutWhatIsFixedAndWhatIsThereAlready) {
  Rig rig = HandheldRig("a");
  rig.fixed = {"imu.*", "cam0.p_CI.*", "cam0.focal.x"};
  std::vector<std::string> names;
  rig.groups = {{"camera", {"cam0.focal.*", "cam0.principal.*"}},
                {"turn", {"cam0.q_CI.*"}}};
  for (const ParameterBlock& block : ParameterBlocks(rig)) {
    names.push_back(block.name);
  }
  // The block cam0.q_CI is the group "turn"; one focal length is no zoom.
  EXPECT_THAT(names,
              ::testing::UnorderedElementsAre("all",
                                              "camera",
                                              "turn",
                                              "cam0.focal",
                                              "cam0.principal",
                                              "cam0.distortion"));
}

}  // namespace
}  // namespace selfcal
