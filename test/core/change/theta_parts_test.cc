#include "core/change/theta_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

TEST(ThetaParts, AreAllGroupsAndTheirParts) {
  std::vector<std::string> names;
  for (const ThetaPart& part : ThetaParts(HandheldRig("a"))) {
    names.push_back(part.name);
    const auto k = part.basis.cols();
    EXPECT_LT(
        (part.basis.transpose() * part.basis - Eigen::MatrixXd::Identity(k, k))
            .norm(),
        1e-12)
        << part.name;
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

TEST(ThetaParts, ExcludeFixedComponentsAndDuplicates) {
  Rig rig = HandheldRig("a");
  rig.fixed = {"imu.*", "cam0.p_CI.*", "cam0.focal.x"};
  std::vector<std::string> names;
  rig.groups = {{"camera", {"cam0.focal.*", "cam0.principal.*"}},
                {"turn", {"cam0.q_CI.*"}}};
  for (const ThetaPart& part : ThetaParts(rig)) {
    names.push_back(part.name);
  }
  // The part cam0.q_CI is the group "turn"; one focal length is not a zoom.
  EXPECT_THAT(names,
              ::testing::UnorderedElementsAre("all",
                                              "camera",
                                              "turn",
                                              "cam0.focal",
                                              "cam0.principal",
                                              "cam0.distortion"));
}

std::map<std::string, double> Shares(const Rig& rig) {
  std::map<std::string, double> shares;
  for (const ThetaPart& part : ThetaParts(rig)) {
    shares[part.name] = part.share;
  }
  return shares;
}

TEST(ThetaParts, HalfIsForTheMostFrequentChanges) {
  std::map<std::string, double> shares = Shares(HandheldRig("a"));
  ASSERT_EQ(shares.size(), 15u);
  EXPECT_DOUBLE_EQ(shares["cam0.q_CI"], 0.25);
  EXPECT_DOUBLE_EQ(shares["cam0.zoom"], 0.25);
  EXPECT_DOUBLE_EQ(shares["all"], 0.5 / 13);
  EXPECT_DOUBLE_EQ(shares["imu.q_AI"], 0.5 / 13);
  Rig rig = HandheldRig("a");
  rig.fixed = {"cam0.*"};
  shares = Shares(rig);
  double sum = 0;
  for (const auto& [name, share] : shares) {
    EXPECT_DOUBLE_EQ(share, 1.0 / static_cast<double>(shares.size())) << name;
    sum += share;
  }
  EXPECT_NEAR(sum, 1, 1e-12);
}

}  // namespace
}  // namespace selfcal
