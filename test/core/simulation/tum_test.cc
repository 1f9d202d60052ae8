#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

using ::testing::HasSubstr;

TEST(TumTest, ReadsPosesAndSkipsCommentsAndEmptyLines) {
  std::vector<TimedPose> poses;
  std::string error;
  ASSERT_TRUE(
      ParseTum("# t tx ty tz qx qy qz qw\n"
               "1.5 1 2 3 0 0 0.6 0.8\r\n"
               "\n"
               "  # indented\n"
               "\t1.6\t-1e-1 2 3  0.5 -0.5 0.5 -0.5",
               &poses,
               &error))
      << error;
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].t_s, 1.5);
  EXPECT_EQ(poses[0].p_GI, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(poses[0].q_GI.z(), 0.6, 1e-15);
  EXPECT_NEAR(poses[0].q_GI.w(), 0.8, 1e-15);
  EXPECT_EQ(poses[1].p_GI.x(), -0.1);
}

TEST(TumTest, NormalisesQuaternionsThatWereRounded) {
  std::vector<TimedPose> poses;
  std::string error;
  ASSERT_TRUE(ParseTum("0 0 0 0 0 0 0.6001 0.8", &poses, &error)) << error;
  EXPECT_NEAR(poses[0].q_GI.norm(), 1, 1e-15);
}

TEST(TumTest, AnEmptyTextHasNoPoses) {
  std::vector<TimedPose> poses(3);
  std::string error;
  EXPECT_TRUE(ParseTum("", &poses, &error));
  EXPECT_TRUE(poses.empty());
}

TEST(TumTest, AMalformedLineIsNamed) {
  const std::string good = "# comment\n0 0 0 0 0 0 0 1\n";
  const struct {
    const char* line;
    const char* message;
  } cases[] = {
      {"1 0 0 0 0 0 1", "7 numbers"},
      {"1 0 0 0 0 0 0 1 5", "more than 8"},
      {"1 0 zero 0 0 0 0 1", "'zero'"},
      {"1 0 0 0 0 0 0 1x", "'1x'"},
      {"1 nan 0 0 0 0 0 1", "'nan'"},
      {"1 0 inf 0 0 0 0 1", "'inf'"},
      {"1 1e999 0 0 0 0 0 1", "'1e999'"},
      {"1 0 0 0 0 0 0 0.9", "0.9000"},
      {"1 0 0 0 0 0 0 0", "0.0000"},
      {"1,0,0,0,0,0,0,1", "'1,0,0,0,0,0,0,1'"},
  };
  for (const auto& c : cases) {
    std::vector<TimedPose> poses;
    std::string error;
    EXPECT_FALSE(ParseTum(good + c.line + "\n", &poses, &error)) << c.line;
    EXPECT_THAT(error, HasSubstr("line 3")) << c.line;
    EXPECT_THAT(error, HasSubstr(c.message)) << c.line;
  }
}

}  // namespace
}  // namespace selfcal
