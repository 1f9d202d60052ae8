#include "core/model/distortion_equidistant.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kTrials = 3000;
using Coefficients = std::array<double, 4>;

Eigen::Vector2d AtAngle(double theta, const Eigen::Vector2d& direction) {
  return std::tan(theta) * direction;
}

TEST(DistortionEquidistant, IsTheFormula) {
  RandomValues random(1);
  for (int i = 0; i < kTrials; ++i) {
    const Coefficients k = {random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1),
                            random.Uniform(0, 0.1)};
    const double theta = random.Uniform(0.01, 1.55);
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    double theta_d = theta;
    for (int j = 0; j < 4; ++j) theta_d += k[j] * std::pow(theta, 2 * j + 3);
    Eigen::Vector2d d;
    ASSERT_TRUE(DistortionEquidistant(k).Distort<double>(
        AtAngle(theta, direction), &d, nullptr, nullptr));
    EXPECT_LT((d - theta_d * direction).norm(), 1e-14);
  }
}

TEST(DistortionEquidistant, RegionEndsWhereTheProfileStopsRising) {
  RandomValues random(2);
  for (int i = 0; i < kTrials; ++i) {
    // 1 + 3 k1 theta^2 has its zero at `border`.
    const double border = random.Uniform(0.2, 1.5);
    const Coefficients k = {-1 / (3 * border * border), 0, 0, 0};
    const Eigen::Vector2d direction = random.Vector(2, 1).normalized();
    Eigen::Vector2d d;
    EXPECT_TRUE(DistortionEquidistant(k).Distort<double>(
        AtAngle(border - 1e-9, direction), &d, nullptr, nullptr));
    EXPECT_FALSE(DistortionEquidistant(k).Distort<double>(
        AtAngle(border + 1e-9, direction), &d, nullptr, nullptr));
    // The profile ends at 2/3 of the angle.
    EXPECT_TRUE(DistortionEquidistant(k).Undistort(
        (2 * border / 3 - 1e-6) * direction, &d));
    EXPECT_FALSE(DistortionEquidistant(k).Undistort(
        (2 * border / 3 + 1e-6) * direction, &d));
  }
}

TEST(DistortionEquidistant, UndistortFindsTheAngleOfEveryRisingProfile) {
  RandomValues random(3);
  int checked = 0;
  for (int i = 0; i < kTrials; ++i) {
    Coefficients k;  // far rougher than any lens
    for (double& value : k) value = random.Uniform(-0.6, 0.6);
    const double theta = std::abs(random.SignedMagnitude(1e-12, 1.5));
    const double Q = theta * theta;
    const double slope =
        1 + Q * (3 * k[0] + Q * (5 * k[1] + Q * (7 * k[2] + Q * 9 * k[3])));
    const Eigen::Vector2d u = AtAngle(theta, random.Vector(2, 1).normalized());
    Eigen::Vector2d d;
    if (!DistortionEquidistant(k).Distort<double>(u, &d, nullptr, nullptr))
      continue;
    if (slope < 0.01) continue;  // ill-conditioned
    Eigen::Vector2d again;
    ASSERT_TRUE(DistortionEquidistant(k).Undistort(d, &again));
    const double angle = std::atan(again.norm());
    EXPECT_NEAR(angle, theta, 3e-15 * theta / slope * (1 + slope));
    EXPECT_LT((again.normalized() - u.normalized()).norm(), 1e-14);
    ++checked;
  }
  EXPECT_GT(checked, kTrials / 2);
}

TEST(DistortionEquidistant, TheAxisIsItsOwnImage) {
  const Coefficients k = {0.1, -0.05, 0.02, 0.01};
  Eigen::Vector2d d;
  Eigen::Matrix2d J;
  Eigen::Matrix<double, 2, 4> J_k;
  ASSERT_TRUE(DistortionEquidistant(k).Distort<double>(
      Eigen::Vector2d::Zero(), &d, &J, &J_k));
  EXPECT_EQ(d, Eigen::Vector2d::Zero());
  EXPECT_EQ(J, Eigen::Matrix2d::Identity());
  EXPECT_TRUE(J_k.isZero(0));
  ASSERT_TRUE(DistortionEquidistant(k).Undistort(Eigen::Vector2d::Zero(), &d));
  EXPECT_EQ(d, Eigen::Vector2d::Zero());
}

}  // namespace
}  // namespace selfcal
